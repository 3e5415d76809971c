"""released.py keep writes the folder of a version, and overwrites one that is there only with --again.

keep.py LIBRARY     forceserver_described
"""
import pathlib
import sys
import tempfile

import released

library = sys.argv[1]
with tempfile.TemporaryDirectory() as temporary:
    released.RELEASED = pathlib.Path(temporary)
    released.keep(library)
    (folder,) = released.kept()
    written = (folder / "symbols").read_text()
    (folder / "symbols").write_text("as it was released")
    try:
        released.keep(library)
    except SystemExit as refusal:
        print(refusal)
    kept = (folder / "symbols").read_text()
    released.keep("--again", library)
    if "fs_version@@FORCESERVER_1" not in written or kept != "as it was released" or (folder / "symbols").read_text() != written:
        sys.exit("it does not keep what is there, or does not write what it should")
