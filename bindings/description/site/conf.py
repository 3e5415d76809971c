"""How Sphinx makes the site; `make` runs it."""
import pathlib
import re
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import comments  # noqa: E402
import forceserver  # noqa: E402

work = pathlib.Path(__file__).resolve().parents[3] / "build" / "site"
project = "forceserver"
version = release = forceserver.__version__
language = "en"
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]
highlight_language = "none"
html_theme = "furo"
html_title = f"forceserver {version}"
html_static_path = ["style.css"]
html_css_files = ["style.css"]
html_extra_path = [str(work / "java" / "site")]
html_show_copyright = html_show_sphinx = html_copy_source = False
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
toc_object_entries_show_parents = "hide"
maximum_signature_line_length = 100
c_maximum_signature_line_length = 100


def docstring(app, what, name, thing, options, lines):
    """Docstrings are comments of the headers, or are written like these: here they become reStructuredText."""
    written = []
    for kind, *said in comments.blocks("\n".join(lines)):
        *terms, text = said
        if kind == "code":
            written += [".. code-block:: none", "", *("   " + line for line in text.splitlines()), ""]
        else:
            text = re.sub(r"([\\*`|_])", r"\\\1", text)
            text = re.sub(r"\\`([^`]+?)\\`", lambda match: "``" + match[1].replace("\\", "") + "``", text)
            text = re.sub(r"In C: (fs\\_\S*\w)", lambda match: f"In C: :c:func:`{match[1].replace(chr(92), '')}`", text)
            written += [("- " if kind == "item" else f"- **{terms[0]}** " if terms else "") + text, ""]
    lines[:] = written


def signature(app, what, name, thing, options, arguments, result):
    """What may be left out is "..." in the package."""
    return (arguments.replace("=Ellipsis", "=..."), result) if "=Ellipsis" in (arguments or "") else None


def setup(app):
    app.connect("autodoc-process-signature", signature)
    app.connect("autodoc-process-docstring", docstring)
