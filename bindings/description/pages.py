"""The pages of the project."""
import re

NOT_OURS = re.compile(r"build.*|node_modules|\.(?!github$).+")  # folders whose pages are not of the project


def pages(folder):
    """Every page (*.md) in a folder and below it, in the order of their names."""
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink() and not NOT_OURS.fullmatch(path.name):
            yield from pages(path)
        elif path.suffix == ".md":
            yield path
