"""Where scenes are kept: files in one folder of this machine, zip files of the browser's, and the recovery file."""

from __future__ import annotations

import hashlib
import io
import os
import shutil
import tempfile
import time
import zipfile
from pathlib import Path

import forceserver as fs

from .plain import Plain, Refused

MOST_BYTES = 1 << 30  # of a zip file's content


class Keep:
    def __init__(self, folder: Path, recovery: Path, endpoint: str, name: str) -> None:
        self.folder = folder.resolve()
        key = hashlib.sha256(f"{endpoint}\n{name}".encode()).hexdigest()[:12]
        self._recovery = recovery / key / "scene.json"
        self._old = self._recovery.parent / "before" / "scene.json"  # from before; it is offered, never applied unasked
        self._changed = 0.0
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
        if not file or not path.is_relative_to(self.folder) or path.name.startswith("."):
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
            scene.load(_unpacked(upload, Path(folder)))

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

    def note_change(self) -> None:
        self._changed = self._changed or time.monotonic()

    def write_recovery(self, scene: fs.Scene, at_once: bool = False) -> None:
        """After a gesture, but not more often than once a second."""
        if not self._changed or (time.monotonic() < self._changed + 1 and not at_once):
            return
        self._recovery.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        scene.save(self._recovery)
        self._changed = 0.0
        text = self._recovery.read_text(errors="replace")
        for path in self._recovery.parent.glob("*.ply"):  # of meshes that are gone
            if path.name not in text:
                path.unlink()

    def offer(self) -> Plain | None:
        try:
            return {"written": self._old.stat().st_mtime}
        except OSError:
            return None

    def offer_again(self) -> None:
        """The scene is gone, with its server or its editor: what was written last is on offer from now on. It is put
        aside, so that what is edited meanwhile is written too."""
        if not self._recovery.exists():
            return
        shutil.rmtree(self._old.parent, ignore_errors=True)
        try:
            self._old.parent.mkdir(mode=0o700)
            for path in [self._recovery, *self._recovery.parent.glob("*.ply")]:
                path.rename(self._old.parent / path.name)
        except OSError as error:  # a folder that cannot be written: the editor works without
            print(f"the recovery file cannot be offered: {error}", flush=True)

    def recover(self, scene: fs.Scene) -> None:
        scene.load(self._old)
        self.discard()

    def discard(self) -> None:
        shutil.rmtree(self._old.parent, ignore_errors=True)


def _unpacked(file: Path, folder: Path) -> Path:
    """Unpacks a zip file, or takes a bare .json. Returns the scene file."""
    if not zipfile.is_zipfile(file):
        return Path(shutil.copy(file, folder / "scene.json"))
    with zipfile.ZipFile(file) as archive:
        infos = [info for info in archive.infolist() if not info.is_dir()]
        if sum(info.file_size for info in infos) > MOST_BYTES:
            raise Refused("the zip file has more than 1 GiB in it", "file", "FULL")
        for info in infos:
            target = (folder / info.filename).resolve()
            if not target.is_relative_to(folder.resolve()):
                raise Refused(f"the zip file names a place outside of it: {info.filename!r}", "file")
            target.parent.mkdir(parents=True, exist_ok=True)
            with archive.open(info) as source, open(target, "wb") as out:
                shutil.copyfileobj(source, out)
    scenes = sorted(folder.rglob("*.json"), key=lambda path: (len(path.parts), path.name != "scene.json"))
    if not scenes:
        raise Refused("the zip file has no scene (.json) in it", "file")
    return scenes[0]


def recovery_folder() -> Path:
    return Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local/state") / "forceserver-editor"
