"""Finds phrases in documents, comments and messages that readers have to read twice.

prose.py [FILE...]: of the repository's files all, or these. Exit status 1 if it finds any.
CONTRIBUTING.md has the rules with examples; PHRASES has what a machine can find of them.
"""

import io
import pathlib
import re
import subprocess
import sys
import tokenize

# A regular expression, and what to write instead.
PHRASES = [
    (r"\b(that|those) of\b(?! course)", "repeat the noun"),
    (r"(?<!there )\b(is|are|was|were|be|being) none\b", "a positive statement: NaN, spurious, empty"),
    (r"(?<!there )(?<!there also )\b(is|are|was|were) no (?!longer|more |less |greater|larger|smaller|"
     r"better|worse|wider|faster|slower)", "a positive statement, or `is not a`"),
    (r"\b(is|are|was|were|been|be) told\b(?! apart)|\btold (in|by|late|here|there)\b",
     "given, known, specified, set, printed, reported"),
    (r"\b(bears?|borne|bearable)\b", "tolerates, allows, withstands, keeps its margin"),
    (r"\bnobody\b", "no one, unknown, or the passive"),
    (r"\banew\b", "again"),
    (r"\bbesides\b", "as well, also, in addition"),
    (r"\bfarther\b", "further"),
    (r"\bwhat is (there|left)\b", "name the thing: the remaining torque, the current posture"),
    (r"\b(gears|joints|springs) that bend\b", "elastic gears, elastic joints"),
    (r"\bsprings? in force\b|\blaw in force\b", "active springs, active law"),
]
# Files, or a text in which a phrase is meant.
EXCEPTIONS = re.compile(
    r"^(CHANGELOG\.md|\.ci/prose\.py|LICENSE|CODE_OF_CONDUCT\.md):"
    r"|^CONTRIBUTING\.md:\d+: \|"
    r"|reaction is no force")
MARKS = r'(?:\s*\n[\s/*!<#"]*|\s+)'  # between the lines of one passage
C_SOURCE = re.compile(r"""//(?P<line>[^\n]*)|/\*(?P<block>.*?)\*/
                      |R"(?P<mark>\w*)\((?P<raw>.*?)\)(?P=mark)"|"(?P<text>(?:[^"\\\n]|\\.)*)"
                      |'(?:[^'\\\n]|\\.)*'|`(?P<template>[^`]*)`""",
                      re.VERBOSE | re.DOTALL)


def comments_and_strings(path, text):
    """Yields (start, end) of each in a program, those of neighbouring lines as one."""
    if path.suffix == ".py":
        starts = [0]
        for line in text.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        spans = [(starts[token.start[0] - 1] + token.start[1], starts[token.end[0] - 1] + token.end[1])
                 for token in tokenize.generate_tokens(io.StringIO(text).readline)
                 if token.type in (tokenize.COMMENT, tokenize.STRING)]
    else:
        spans = [found.span(found.lastgroup) for found in C_SOURCE.finditer(text)
                 if found.lastgroup not in (None, "mark")]
    whole = []
    for start, end in spans:
        if whole and re.fullmatch(r'["\s/!<#*]*', text[whole[-1][1]:start]):
            whole[-1] = (whole[-1][0], end)
        else:
            whole.append((start, end))
    return whole


def passages(path, text):
    """Yields the prose of a file as lists of (offset, character), with single blanks."""
    spans = [(0, len(text))]
    if path.suffix == ".md":
        text = re.sub(r"```.*?```", lambda code: re.sub(r"\S", " ", code.group()), text, flags=re.DOTALL)
    elif path.suffix in (".py", ".cpp", ".hpp", ".h", ".c", ".js", ".lcm"):
        spans = comments_and_strings(path, text)
    elif path.suffix in (".yaml", ".yml", ".cmake", ".html") or path.name in ("run", "CMakeLists.txt"):
        code = r"<[^>]*>" if path.suffix == ".html" else r"^[^#\n]*"
        text = re.sub(code, lambda code: re.sub(r"\S", " ", code.group()), text, flags=re.MULTILINE)
    else:
        return
    for start, end in spans:
        prose = []
        for piece in re.finditer(MARKS + r"|[^\s]", text[start:end]):
            character = piece.group() if len(piece.group()) == 1 else " "
            prose.append((start + piece.start(), character if character.strip() else " "))
        yield prose


def main():
    names = sys.argv[1:] or subprocess.run(
        ["git", "ls-files"], check=True, text=True, stdout=subprocess.PIPE).stdout.split()
    found = 0
    for path in map(pathlib.Path, names):
        try:
            text = path.read_text(encoding="utf-8")
        except (UnicodeDecodeError, OSError):
            continue
        for prose in passages(path, text):
            plain = "".join(character for _, character in prose)
            for phrase, better in PHRASES:
                for match in re.finditer(phrase, plain, re.IGNORECASE):
                    number = text.count("\n", 0, prose[match.start()][0]) + 1
                    message = f"{path}:{number}: {text.splitlines()[number - 1].strip()}"
                    if not EXCEPTIONS.search(message):
                        found += 1
                        print(f"{message}\n    '{match.group()}': {better}")
    return found > 0


sys.exit(main())
