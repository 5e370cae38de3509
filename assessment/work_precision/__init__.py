"""Error against run time. `run` computes, draws and writes the report; a study is a function from `Settings` to a dict
that it makes with `study_of`, and its texts are in words.toml."""
