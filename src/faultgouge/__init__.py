"""Remote triggering in a stressed layer of frictional disks.

``faultgouge.analysis`` takes a configuration and gives its Jacobian, spectrum, onset and growth;
``faultgouge.pywrap`` drives LAMMPS from a scene to stored configurations; ``faultgouge.studies`` puts
results on paper.
"""

from importlib.metadata import version

__version__ = version("faultgouge")
