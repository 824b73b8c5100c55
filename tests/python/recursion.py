"""Finds functions of the core that can call themselves, directly or through others.

    python3 tests/python/recursion.py core/src

A call graph by name: a function is an edge to every free function, `self.method` and `Self::method`
that it applies. Methods of other values are left out: what they could recurse through is no part of
this code. Functions of one name are one node, so it errs toward reporting. Exit 1 at a cycle.
"""

import re
import sys
from pathlib import Path

FUNCTION = re.compile(r"\bfn\s+([a-z_][a-z0-9_]*)")
CALL = re.compile(r"(?:(?<![.:\w])|(?<=\bself\.)|(?<=\bSelf::))([a-z_][a-z0-9_]*)(?:::<[^>()]*>)?\(")
TEST = re.compile(r"#\[cfg\(test\)\]\s*mod\s+\w+\s*\{")
def body(text, start):
    """The braces that follow `start`."""
    opening = text.find("{", start)
    semicolon = text.find(";", start)
    if opening < 0 or (0 <= semicolon < opening):
        return ""
    depth = 0
    for at in range(opening, len(text)):
        depth += {"{": 1, "}": -1}.get(text[at], 0)
        if depth == 0:
            return text[opening : at + 1]
    return text[opening:]


def main(folder):
    calls = {}
    for path in sorted(Path(folder).rglob("*.rs")):
        if path.name == "tests.rs" or "tests" in path.parts:
            continue
        text = re.sub(r"//[^\n]*", "", path.read_text())
        tests = TEST.search(text)
        text = text[: tests.start()] if tests else text
        for match in FUNCTION.finditer(text):
            found = set(CALL.findall(body(text, match.end())))
            calls.setdefault(match[1], set()).update(found)
    state = {}
    for root in calls:
        stack = [(root, iter(sorted(calls[root])))]
        state.setdefault(root, "open")
        trail = [root]
        if state[root] == "done":
            continue
        while stack:
            name, rest = stack[-1]
            callee = next((c for c in rest if c in calls), None)
            if callee is None:
                state[name] = "done"
                stack.pop()
                trail.pop()
            elif state.get(callee) == "open":
                print("possible recursion:", " -> ".join(trail + [callee]))
                return 1
            elif callee not in state:
                state[callee] = "open"
                stack.append((callee, iter(sorted(calls[callee]))))
                trail.append(callee)
    print(f"no recursion among {len(calls)} functions")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
