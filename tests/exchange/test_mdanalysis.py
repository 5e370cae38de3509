def test_what_is_no_run_is_refused_as_before_the_import(tmp_path):
    (tmp_path / "run.h5").write_bytes(b"no HDF5")
    with pytest.raises(PackingFileError, match="is of no format that is read: give"):
        read_disks(tmp_path / "run.h5")
