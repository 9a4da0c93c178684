"""Finds the small changes that can be made to C++ sources, each to be switched on at run time."""

import re
from dataclasses import dataclass

from clang.cindex import CursorKind as Kind
from clang.cindex import Index

# Replacements of an operator, with the name of each change.
SWAPS = {
    "<": [("<=", "boundary"), (">=", "negated")],
    "<=": [("<", "boundary"), (">", "negated")],
    ">": [(">=", "boundary"), ("<=", "negated")],
    ">=": [(">", "boundary"), ("<", "negated")],
    "==": [("!=", "negated")],
    "!=": [("==", "negated")],
    "&&": [("||", "logic")],
    "||": [("&&", "logic")],
    "+": [("-", "arithmetic")],
    "-": [("+", "arithmetic")],
    "*": [("/", "arithmetic")],
    "/": [("*", "arithmetic")],
    "+=": [("-=", "arithmetic")],
    "-=": [("+=", "arithmetic")],
    "*=": [("/=", "arithmetic")],
    "/=": [("*=", "arithmetic")],
}
OPERATOR = re.compile(r"<=|>=|==|!=|&&|\|\||[-+*/|&]=|[-+*/<>=]")
FUNCTIONS = (Kind.FUNCTION_DECL, Kind.CXX_METHOD, Kind.CONSTRUCTOR, Kind.DESTRUCTOR,
             Kind.FUNCTION_TEMPLATE, Kind.CONVERSION_FUNCTION)
STATEMENTS = (Kind.COMPOUND_STMT, Kind.IF_STMT, Kind.FOR_STMT, Kind.WHILE_STMT,
              Kind.CXX_FOR_RANGE_STMT, Kind.DO_STMT, Kind.CASE_STMT, Kind.DEFAULT_STMT)
# Not compiled into anything that runs, fixed at compile time, or the text of a complaint.
LEFT_ALONE = (Kind.STATIC_ASSERT, Kind.ENUM_DECL, Kind.CXX_THROW_EXPR, Kind.TYPE_ALIAS_DECL,
              Kind.TYPEDEF_DECL, Kind.TEMPLATE_NON_TYPE_PARAMETER, Kind.TEMPLATE_TYPE_PARAMETER)
EXPRESSION = "(dashpot_mutant({k}) ? ({new}) : ({old}))"
VALUE = "(dashpot_mutant({k}) ? dashpot_plain({new}) : dashpot_plain({old}))"
STATEMENT = "{{ if (dashpot_mutant({k})) {{ {new} }} else {{ {old} }} }}"


@dataclass(frozen=True)
class Change:
    file: str  # below the root of the tree
    line: int
    begin: int  # of the bytes that it replaces
    end: int
    operator: str
    old: str  # in one line
    new: str
    form: str  # of the code that switches between the two
    keyword: tuple = ()  # begin and end of a `constexpr` that is in the way, and what replaces it


def one_line(text):
    return " ".join(re.sub(r"//[^\n]*", " ", text).split())


class Finder:
    """Walks through the syntax tree of one file."""

    def __init__(self, name, path):
        self.name = name
        with open(path, "rb") as file:
            self.bytes = file.read()
        self.found = {}

    def text(self, begin, end):
        return self.bytes[begin:end].decode()

    def source(self, cursor):
        return self.text(cursor.extent.start.offset, cursor.extent.end.offset)

    def add(self, operator, begin, end, new, form, keyword=()):
        old = one_line(self.text(begin, end))
        line = self.bytes.count(b"\n", 0, begin) + 1
        change = Change(self.name, line, begin, end, operator, old, one_line(new), form, keyword)
        if old and old != change.new:
            self.found[(begin, end, change.new)] = change

    def change(self, operator, cursor, new, form=EXPRESSION):
        self.add(operator, cursor.extent.start.offset, cursor.extent.end.offset, new, form)

    def statement(self, operator, cursor, new):
        begin, end = cursor.extent.start.offset, cursor.extent.end.offset
        rest = re.match(rb"\s*;", self.bytes[end:])
        if rest:
            self.add(operator, begin, end + rest.end(), new, STATEMENT)

    def walk(self, cursor, parent=None, function=None):
        kind = cursor.kind
        if kind in LEFT_ALONE:
            return
        if kind in FUNCTIONS:
            body = [child for child in cursor.get_children() if child.kind == Kind.COMPOUND_STMT]
            head = self.text(cursor.extent.start.offset,
                             body[0].extent.start.offset if body else cursor.extent.end.offset)
            if not body or re.search(r"\b(constexpr|consteval)\b", head):
                return
            function = cursor
        elif kind in (Kind.VAR_DECL, Kind.FIELD_DECL) and self.constant(cursor):
            return
        self.look(cursor, parent, function)
        inner = parent if kind == Kind.UNEXPOSED_EXPR else cursor
        for child in cursor.get_children():
            if child.kind != Kind.PARM_DECL:
                self.walk(child, inner, function)

    def constant(self, cursor):
        """A constexpr variable, which is made a const one; whether it is one."""
        begin = self.bytes.rfind(b"constexpr", 0, cursor.extent.end.offset)
        start = cursor.extent.start.offset
        if begin < start or self.bytes.find(b";", begin, cursor.location.offset) >= 0:
            return False
        if b"=" in self.bytes[begin:cursor.location.offset]:  # a later one of several
            return True
        value = list(cursor.get_children())[-1:]
        number = cursor.type.get_canonical().spelling
        if not value or number not in ("const double", "const int"):
            return True
        local = cursor.semantic_parent.kind in FUNCTIONS
        keyword = (begin, begin + len("constexpr"), "const" if local else "inline const")
        old = self.source(value[0])
        news = [f"10 * ({old})", f"0.1 * ({old})"] if "double" in number else [f"({old}) + 1"]
        for new in news:
            self.add("constant", value[0].extent.start.offset, value[0].extent.end.offset, new,
                     EXPRESSION, keyword)
        return True

    def look(self, cursor, parent, function):
        kind = cursor.kind
        own = parent is not None and parent.kind in STATEMENTS and self.is_statement(cursor, parent)
        if kind in (Kind.BINARY_OPERATOR, Kind.COMPOUND_ASSIGNMENT_OPERATOR, Kind.CALL_EXPR):
            self.operation(cursor, parent, own)
        if kind == Kind.CALL_EXPR:
            self.call(cursor)
        if kind == Kind.UNARY_OPERATOR:
            self.unary(cursor)
        if kind in (Kind.FLOATING_LITERAL, Kind.INTEGER_LITERAL, Kind.CXX_BOOL_LITERAL_EXPR):
            self.literal(cursor, parent)
        if kind in (Kind.IF_STMT, Kind.CONDITIONAL_OPERATOR):
            self.condition(cursor)
        if kind == Kind.RETURN_STMT:
            self.result(cursor, function)
        if kind in (Kind.CONTINUE_STMT, Kind.BREAK_STMT):
            self.statement("removed", cursor, "")
        expression = (Kind.BINARY_OPERATOR, Kind.COMPOUND_ASSIGNMENT_OPERATOR, Kind.CALL_EXPR,
                      Kind.UNARY_OPERATOR)
        if own and kind in expression:
            self.statement("removed", cursor, "")

    def is_statement(self, cursor, parent):
        """Not the condition or the step of what it belongs to."""
        children = list(parent.get_children())
        if parent.kind == Kind.IF_STMT:
            return cursor.extent.start.offset > children[0].extent.end.offset
        if parent.kind in (Kind.FOR_STMT, Kind.CXX_FOR_RANGE_STMT, Kind.WHILE_STMT):
            return cursor.extent.end.offset == parent.extent.end.offset
        return parent.kind != Kind.DO_STMT

    def operation(self, cursor, parent, own):
        sides = list(cursor.get_arguments() if cursor.kind == Kind.CALL_EXPR
                     else cursor.get_children())
        if len(sides) != 2 or "string" in cursor.type.get_canonical().spelling:
            return
        begin, end = sides[0].extent.end.offset, sides[1].extent.start.offset
        between = self.text(begin, end)
        if begin >= end or "(" in between or "," in between:
            return
        match = OPERATOR.search(between)
        left, right = self.source(sides[0]), self.source(sides[1])
        if not match or not left:
            return
        operator = match.group()
        in_for = parent is not None and parent.kind == Kind.FOR_STMT and not own
        if in_for and operator in ("<", ">="):
            new = f"{left} + 1 < {right}" if operator == "<" else f"{left} > {right}"
            self.change("last pass", cursor, new)
            return
        if in_for:
            return
        for other, name in SWAPS.get(operator, []):
            new = f"{left} {other} {right}"
            if operator in "+-" and re.fullmatch(r"\w+ [+-] 1", one_line(self.source(cursor))):
                continue  # a neighbour's place
            if operator in "+-*/":
                self.change(name, cursor, new, VALUE)
            elif operator.endswith("=") and name == "arithmetic":
                if own:
                    self.statement(name, cursor, new + ";")
            else:
                self.change(name, cursor, new)

    def call(self, cursor):
        text = self.source(cursor)
        match = re.match(r"std::(max|min|clamp|abs)\b", text)
        arguments = list(cursor.get_arguments())
        if not match or not arguments:
            return
        name = match.group(1)
        if name in ("max", "min"):
            other = "min" if name == "max" else "max"
            self.change("extreme", cursor, f"std::{other}" + text[match.end():])
        else:
            self.change("unbounded" if name == "clamp" else "sign", cursor,
                        self.source(arguments[0]))

    def unary(self, cursor):
        text = self.source(cursor)
        operand = list(cursor.get_children())
        if text[:1] == "!":
            self.change("negated", cursor, self.source(operand[0]))
        elif text[:1] == "-" and text[:2] != "--":
            self.change("sign", cursor, self.source(operand[0]), VALUE)

    def literal(self, cursor, parent):
        begin, end = cursor.extent.start.offset, cursor.extent.end.offset
        text = self.text(begin, end)
        if cursor.kind == Kind.CXX_BOOL_LITERAL_EXPR:
            self.change("flag", cursor, "false" if text == "true" else "true")
            return
        before, after = self.text(begin - 2, begin), self.text(end, end + 1)
        if before.endswith("<") or after == ">" or before.endswith("["):  # template, place in one
            return
        if cursor.kind == Kind.INTEGER_LITERAL:
            if text.isdigit() and parent is not None and parent.kind != Kind.CASE_STMT:
                self.change("constant", cursor, str(int(text) + 1))
        elif float(text) == 0 if re.fullmatch(r"[-+.\de]+", text) else False:
            self.change("constant", cursor, "1.0")
        else:
            self.change("constant", cursor, f"10 * {text}")
            self.change("constant", cursor, f"0.1 * {text}")

    def condition(self, cursor):
        first = next(cursor.get_children())
        text = self.text(cursor.extent.start.offset, first.extent.start.offset)
        if cursor.kind == Kind.IF_STMT and text.replace(" ", "") != "if(":
            return
        if first.kind.is_expression():
            self.change("always", first, "true")
            self.change("never", first, "false")

    def result(self, cursor, function):
        value = list(cursor.get_children())
        if not value:
            self.statement("removed", cursor, "")
        elif function is not None and function.result_type.spelling == "bool":
            self.change("negated", value[0], f"!({self.source(value[0])})")


def find(files, root, units):
    """The changes possible in `files` (below `root`); `units` gives those to parse: path, text (or
    None for that on disk) and the compiler's arguments."""
    finders = {f"{root}/{name}": Finder(name, f"{root}/{name}") for name in files}
    index = Index.create()
    for path, text, arguments in units:
        unit = index.parse(path, arguments, None if text is None else [(path, text)])
        errors = [str(problem) for problem in unit.diagnostics if problem.severity >= 3]
        if errors:
            raise SystemExit("mutate: clang does not read this:\n" + "\n".join(errors[:5]))
        walk_files(unit.cursor, finders)
    return [change for finder in finders.values() for change in finder.found.values()]


def walk_files(cursor, finders):
    """Walks through what of a translation unit stands in the files looked for."""
    for child in cursor.get_children():
        file = child.location.file
        finder = finders.get(file.name) if file else None
        if finder is None:
            continue
        if child.kind in (Kind.NAMESPACE, Kind.LINKAGE_SPEC, Kind.UNEXPOSED_DECL):
            walk_files(child, finders)
        else:
            finder.walk(child)
