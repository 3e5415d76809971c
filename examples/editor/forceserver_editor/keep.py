"""Where scenes are kept: files in one folder of this machine, zip files of the browser's, and the recovery file."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import tempfile
import time
import zipfile
import zlib
from pathlib import Path
from typing import IO

import forceserver as fs

from .plain import Plain, Refused, refusal

# Of an upload, as it is on the disk: what is larger is refused before it is read. Of a scene's JSON the library may need 24
# times the size to read it.
MOST_SCENE = 32 << 20  # bytes
MOST_FILE = 512 << 20  # bytes of any other file
MOST_UNPACKED = 1 << 30  # bytes, of all files together
MOST_FILES = 5000  # a scene has 4096 objects at most, unless the server allows more


class Keep:
    def __init__(self, folder: Path, recovery: Path, endpoint: str, name: str) -> None:
        self.folder = folder.resolve()
        key = hashlib.sha256(f"{endpoint}\n{name}".encode()).hexdigest()[:12]
        self._recovery = recovery / key / "scene.json"
        self._old = self._recovery.parent / "before" / "scene.json"  # from before; it is offered, never applied unasked
        self.on_offer: Plain | None = None  # for the page; other threads may read it
        self._changed = 0.0  # when the scene was first edited since it was written; 0: it was not
        self._changed_in = 0  # the connection that scene is of
        self.offer_again()

    # ---- The folder

    def files(self) -> list[str]:
        found = [path for path in self.folder.glob("*.json") if path.is_file() and not path.is_symlink()]
        return sorted(path.name for path in found)[:1000]

    def _path(self, file: str) -> Path:
        """Within the folder, also by links and dots."""
        name = file if file.endswith(".json") else file + ".json"
        path = (self.folder / name).resolve()
        if not file.isprintable():
            raise Refused(f"{file!r} has a character that cannot be shown", "file")
        if not file or ".." in Path(file).parts or not path.is_relative_to(self.folder) or path.name.startswith("."):
            raise Refused(f"{file!r} is not within the folder {self.folder}", "file")
        return path

    def save(self, scene: fs.Scene, file: str) -> str:
        path = self._path(file)
        if not path.parent.is_dir():
            raise Refused(f"there is no folder {path.parent}", "file")
        scene.save(path)
        return str(path.relative_to(self.folder))

    def load(self, scene: fs.Scene, file: str, upload: Path | None) -> None:
        if upload is None:
            scene.load(self._path(file))
            return
        with tempfile.TemporaryDirectory() as folder:
            try:
                scene.load(_unpacked(upload, Path(folder)))
                return
            except fs.Error as error:
                refused = refusal(error)
            except OSError as error:
                refused = Refused(str(error), "file", "IO")
            refused.text = refused.text.replace(f"{folder}/", "")  # the person knows the files by their names alone
            raise refused

    def packed(self, scene: fs.Scene) -> bytes:
        """The scene with its meshes as a zip file."""
        with tempfile.TemporaryDirectory() as folder:
            scene.save(Path(folder) / "scene.json")
            out = io.BytesIO()
            with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
                for path in sorted(Path(folder).iterdir()):
                    archive.write(path, path.name)
            return out.getvalue()

    # ---- Recovery

    def note_change(self, connection: int) -> None:
        is_first = not self._changed or connection != self._changed_in
        self._changed, self._changed_in = time.monotonic() if is_first else self._changed, connection

    def write_recovery(self, scene: fs.Scene, connection: int, at_once: bool = False) -> None:
        """After a gesture, but not more often than once a second. What was edited in a scene that has gone is not to be
        found in the next one."""
        if not self._changed or connection != self._changed_in or (time.monotonic() < self._changed + 1 and not at_once):
            return
        self._recovery.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        scene.save(self._recovery)
        self._changed = 0.0
        text = self._recovery.read_text(errors="replace")
        for path in self._recovery.parent.glob("*.ply"):  # of meshes that are gone
            if path.name not in text:
                path.unlink()

    def offer_again(self) -> None:
        """The scene is gone, with its server or its editor: what was written last is on offer from now on. It is put
        aside, so that what is edited meanwhile is written too."""
        if self._recovery.exists():
            shutil.rmtree(self._old.parent, ignore_errors=True)
            try:
                self._old.parent.mkdir(mode=0o700)
                for path in [self._recovery, *self._recovery.parent.glob("*.ply")]:
                    path.rename(self._old.parent / path.name)
            except OSError as error:  # a folder that cannot be written: the editor works without
                print(f"the recovery file cannot be offered: {error}", flush=True)
        self.on_offer = {"written": self._old.stat().st_mtime} if self._old.exists() else None

    def recover(self, scene: fs.Scene) -> None:
        scene.load(self._old)

    def discard(self) -> None:
        shutil.rmtree(self._old.parent, ignore_errors=True)
        self.on_offer = None


def _unpacked(file: Path, folder: Path) -> Path:
    """Unpacks a zip file, or takes a bare .json. Returns the scene file."""
    if not zipfile.is_zipfile(file):
        _require_size(file.stat().st_size, MOST_SCENE, "the scene")
        return Path(shutil.copy(file, folder))
    try:
        with zipfile.ZipFile(file) as archive:
            _unpack(archive, folder)
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:  # RuntimeError: it needs a password
        raise Refused(f"the zip file cannot be read: {error}", "file", "PARSE") from None
    scenes = sorted(folder.rglob("*.json"), key=lambda path: (len(path.parts), path.name != "scene.json"))
    if not scenes:
        raise Refused("the zip file has no scene (.json) in it", "file")
    return scenes[0]


def _unpack(archive: zipfile.ZipFile, folder: Path) -> None:
    """What the directory of the archive claims is checked first, and then what really comes out of it."""
    infos = [info for info in archive.infolist() if not info.is_dir()]
    if len(infos) > MOST_FILES:
        raise Refused(f"the zip file has {len(infos)} files in it, may have {MOST_FILES}", "file", "FULL")
    _require_size(sum(info.file_size for info in infos), MOST_UNPACKED, "the content of the zip file")
    for info in infos:
        _require_size(info.file_size, _most(info), repr(info.filename))
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise Refused(f"{info.filename!r} is compressed in another way than zip files usually are", "file", "UNSUPPORTED")
        if not info.filename or folder.resolve() not in (folder / info.filename).resolve().parents:
            raise Refused(f"the zip file names a place outside of it: {info.filename!r}", "file")
    left = MOST_UNPACKED
    for info in infos:
        target = (folder / info.filename).resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        with archive.open(info) as source, open(target, "wb") as out:
            left -= copy_at_most(source, out, min(left, _most(info)), repr(info.filename))


def _most(info: zipfile.ZipInfo) -> int:
    return MOST_SCENE if Path(info.filename).suffix.lower() == ".json" else MOST_FILE


def copy_at_most(source: IO[bytes], out: IO[bytes], most: int, what: str) -> int:
    """Returns how many bytes there were."""
    count = 0
    while piece := source.read(1 << 20):
        count += len(piece)
        _require_size(count, most, what)
        out.write(piece)
    return count


def _require_size(size: int, most: int, what: str) -> None:
    if size > most:
        raise Refused(f"{what} is too large: unpacked it may have {most >> 20} MiB", "file", "FULL")


def recovery_folder() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state") / "forceserver-editor"
