"""Makes of doxygen's pages one site, for ./run docs.

site.py python FILE: writes the reference of the Python package, from its sources, as a document.
site.py finish: checks every link of build/docs/html, and writes the index of docs/search.js.
"""
import ast
import html.parser
import json
import pathlib
import re
import sys
import textwrap
import urllib.parse

PACKAGE = pathlib.Path("python/dashpot")
SITE = pathlib.Path("build/docs/html")


def prose(text):
    """Returns a docstring as Markdown in which only its code and paragraphs mean something."""
    parts = re.split(r"(`[^`]*`|^ {4}.*$)", text or "", flags=re.M)
    parts[::2] = [re.sub(r"[<>@\\#%&*|]", r"\\\g<0>", part) for part in parts[::2]]
    return "".join(parts)


def signature(name, function):
    arguments = re.sub(r"^(self|cls)(, |$)", "", ast.unparse(function.args))
    returns = f" -> {ast.unparse(function.returns)}" if function.returns else ""
    text = re.sub(r"(?<!,) ", "\xa0", f"{name}({arguments}){returns}".replace("npt.", ""))  # lines end after commas
    lines = textwrap.wrap(text, 100, subsequent_indent="    ", break_on_hyphens=False, break_long_words=False)
    return "```py\n" + "\n".join(lines).replace("\xa0", " ") + "\n```\n"


def is_property(function):
    return any(isinstance(one, ast.Name) and one.id == "property" for one in function.decorator_list)


def describe(module, name, node):
    """Yields the parts of a call or type, as Markdown."""
    yield f"\n## {module}.{name} {{#{module.replace('.', '-')}-{name}}}\n"
    if isinstance(node, ast.FunctionDef):
        yield signature(name, node)
    yield prose(ast.get_docstring(node)) + "\n"
    if not isinstance(node, ast.ClassDef):
        return
    for base in node.bases:
        if ast.unparse(base) != "Result":
            yield f"Base: `{ast.unparse(base)}`\n"
    for field, comment in zip(node.body, node.body[1:] + [None]):
        if isinstance(field, ast.AnnAssign) and not ast.unparse(field.target).startswith("_"):
            text = ast.literal_eval(comment.value) if isinstance(comment, ast.Expr) else ""
            yield f"- `{ast.unparse(field.target)}: {ast.unparse(field.annotation)}` {prose(' '.join(text.split()))}"
    for method in node.body:
        if isinstance(method, ast.FunctionDef) and (method.name == "__init__" or method.name[0] != "_"):
            title = name if method.name == "__init__" else f"{name}.{method.name}"
            if is_property(method):
                yield f"\n### {title}\n`{ast.unparse(method.returns)}`: " + prose(ast.get_docstring(method)) + "\n"
            else:
                yield f"\n### {title}()\n" + signature(method.name, method) + prose(ast.get_docstring(method)) + "\n"


def python_reference(out):
    trees = {path.stem: ast.parse(path.read_text()) for path in sorted(PACKAGE.glob("*.py*")) if path.stat().st_size}
    public = next(ast.literal_eval(node.value) for node in trees["__init__"].body
                  if isinstance(node, ast.Assign) and node.targets[0].id == "__all__")
    found = {node.name: node for stem, tree in trees.items() if stem.startswith("_") for node in tree.body
             if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and (stem != "_core" or node.name == "Error")}
    parts = ["# Python reference {#python-reference}\n", prose(ast.get_docstring(trees["__init__"])) + "\n",
             "[The document about the package](@ref python) has examples.\n"]
    for name in sorted(public, key=str.lower):
        parts += describe("dashpot", name, found[name])
    for stem in ("franka", "ros"):
        for node in trees[stem].body:
            if isinstance(node, (ast.ClassDef, ast.FunctionDef)) and node.name[0] != "_":
                parts += describe(f"dashpot.{stem}", node.name, node)
    pathlib.Path(out).write_text("\n".join(parts))


class Page(html.parser.HTMLParser):
    """Links and anchors of a page, and its text in sections: [anchor, title, text]."""

    def __init__(self, path):
        super().__init__()
        self.path, self.links, self.anchors, self.sections = path, [], set(), [["", "", ""]]
        self.title, self.within, self.heading = "", False, ""
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.links += [values[key] for key in ("href", "src") if values.get(key) and values.get("rel") != "search"]
        self.anchors |= {values[key] for key in ("id", "name") if values.get(key)}
        if tag == "a" and "id" in values and not values.get("href"):
            self.sections.append([values["id"], "", ""])
        self.within = self.within or values.get("class") in ("contents", "textblock")
        self.heading = tag if tag in ("title", "h1", "h2", "h3", "h4") else self.heading

    def handle_endtag(self, tag):
        self.heading = "" if tag == self.heading else self.heading

    def handle_data(self, data):
        if self.heading == "title":
            self.title += data
        elif self.within:
            self.sections[-1][1 if self.heading and not self.sections[-1][2].strip() else 2] += data


def broken(pages):
    for page in pages.values():
        for link in page.links:
            url = urllib.parse.urlsplit(link)
            if url.scheme or url.fragment == "nested-classes":  # doxygen forgets this anchor
                continue
            target = (page.path.parent / urllib.parse.unquote(url.path) if url.path else page.path).resolve()
            if not target.is_file():
                yield f"{page.path}: there is no {link}"
            elif url.fragment and target in pages and url.fragment not in pages[target].anchors:
                yield f"{page.path}: no anchor {link}"


def finish():
    pages = {path.resolve(): Page(path) for path in sorted(SITE.rglob("*.html"))}
    faults = sorted(set(broken(pages)))
    index = []
    for page in pages.values():
        if re.search(r"_8md\.html|^(functions|globals|dir_|search|annotated|tree|files)",
                     str(page.path.relative_to(SITE))):  # lists of what other pages say
            continue
        name = page.title.partition(": ")[2]
        for anchor, title, text in page.sections:
            text = " ".join(text.split())
            if text or title.strip():
                title = " ".join(title.replace("\u25c6", "").split())  # doxygen's sign of a link
                index.append([page.path.name + ("#" + anchor if anchor else ""), name, title, text])
    (SITE / "search/index.js").write_text("window.searchIndex = " + json.dumps(index, ensure_ascii=False) + ";\n")
    links = sum(len(page.links) for page in pages.values())
    print(f"{len(pages)} pages, {links} links, {len(index)} sections to search")
    sys.exit("\n".join(faults) or 0)


if sys.argv[1] == "python":
    python_reference(sys.argv[2])
else:
    finish()
