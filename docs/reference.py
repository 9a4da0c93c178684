"""Turns a file into what doxygen understands, for ./run docs: reference.py FILE.

In documents, links to other documents, to headings and to public headers become references. Other files of
the tree that they link to are copied into build/docs/html/tree, where these links lead. In the C interface plain
comments become documentation.
"""
import html
import os
import re
import shutil
import sys

# a block of code, a heading, a link, or code in a line
PARTS = re.compile(r"^```.*?^```|^#+ ([^\n]*)$|\[((?:`[^`]*`|[^]`])*)\]\(([^()\s]+)\)|`[^`\n]*`", re.M | re.S)
LIBRARIES = ("analysis", "controller", "identification", "lcmtypes", "sim", "text")
SITE = "build/docs/html/"
LISTS = ("docs/README.md", "docs/decisions/README.md")  # the documents that they name are below them


def page(path):
    return "index" if path == "README.md" else path[:-3].replace("docs/", "").replace("/", "-").lower()


def copy(file):
    """Returns where the site has a file or folder of the tree: pictures as they are, others as text on a page."""
    place = "tree/" + file
    if file.endswith((".svg", ".png")):
        os.makedirs(os.path.dirname(SITE + place), exist_ok=True)
        shutil.copyfile(file, SITE + place)
        return place
    if os.path.isdir(file):
        names = sorted(os.listdir(file))
        text = "".join(f'<a href="{os.path.relpath(copy(os.path.join(file, name)), place)}">{name}</a>\n'
                       for name in names if not name.startswith((".", "__")))
        place += "/index.html"
    else:
        with open(file, encoding="utf-8") as stream:
            text = html.escape(stream.read())
        place += ".html"
    os.makedirs(os.path.dirname(SITE + place), exist_ok=True)
    with open(SITE + place, "w", encoding="utf-8") as stream:
        stream.write(f'<!DOCTYPE html>\n<meta charset="utf-8">\n<title>{file}</title>\n<pre>{text}</pre>\n')
    return place


def link(path, text, target):
    text = " ".join(text.split())  # doxygen ends a link with its line
    if "://" in target:
        return f"[{text}]({target})"
    file, _, heading = target.partition("#")
    file = os.path.normpath(os.path.join(os.path.dirname(path), file)) if file else path
    if not os.path.exists(file):
        return f"[{text}](@ref {file})"  # which doxygen reports
    if file.endswith(".md"):
        if path in LISTS and not heading and file not in ("README.md", LISTS[0]):
            return f'@subpage {page(file)} "{text}"'
        return f"[{text}](@ref {page(file)}{'--' + heading if heading else ''})"
    if os.path.dirname(file) in LIBRARIES and file.endswith((".h", ".hpp")):
        return f"[{text}](@ref {file})"
    return f"[{text}]({copy(file)})"


def document(path, text):
    anchors = []

    def part(match):
        if match[3] is not None:
            return link(path, match[2], match[3])
        if match[1] is None:
            return match[0]
        title = PARTS.sub(part, match[1])
        if match[0].startswith("# "):
            return match[0] if path == "README.md" else f"# {title} {{#{page(path)}}}"
        anchor = re.sub(r"[^\w-]", "", match[1].replace(" ", "-")).lower()  # as GitHub and tests/project/rules.hpp
        anchors.append(anchor)
        again = anchors.count(anchor) - 1
        return f"{match[0].split()[0]} {title} {{#{page(path)}--{anchor}{f'-{again}' if again else ''}}}"

    below = "\nThe calls of Python: @subpage python-reference\n" if path == LISTS[0] else ""
    return PARTS.sub(part, text) + below


def interface(text):
    lines = [line for line in text.splitlines() if "NOLINT" not in line]
    lines = [re.sub(r"^( *)/\*", r"\1/**", re.sub(r"([;,{]) */\*", r"\1 /**<", line))
             for line in lines]
    return "\n".join(lines).replace("/**", "/** @file\n", 1)


def main(path):
    with open(path, encoding="utf-8") as file:
        text = file.read()
    path = os.path.relpath(path)
    print(document(path, text) if path.endswith(".md") else interface(text))


main(*sys.argv[1:])
