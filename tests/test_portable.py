"""What differs between machines is said, not left to the machine."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDERS = ("src", "tests", "examples")
FILES = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob("*.py"))]


def nodes(path, words):
    """All that stands in a file, if a word does; kept, millions are a burden to other tests."""
    text = path.read_text(encoding="utf-8")
    return ast.walk(ast.parse(text)) if any(word in text for word in words) else ()


def is_text_of_no_encoding(call):
    """Whether a call reads or writes text in whatever encoding the machine is used to."""
    name = getattr(call.func, "attr", getattr(call.func, "id", ""))
    if "encoding" in {keyword.arg for keyword in call.keywords}:
        return False
    if name == "read_text":
        return not call.args
    if name == "write_text":
        return len(call.args) < 2
    if name == "open" and not isinstance(call.func, ast.Attribute):
        return not any("b" in ast.literal_eval(mode) for mode in call.args[1:2])
    if name == "open":  # of a path; a module's own open has a path as its first argument
        modes = [a.value for a in call.args if isinstance(a, ast.Constant)]
        text = any(isinstance(mode, str) and set(mode) <= set("rwxat+") for mode in modes)
        return text or not call.args
    return False


def test_every_text_is_read_and_written_in_an_encoding_that_is_named():
    result = [
        f"{path.relative_to(ROOT).as_posix()}:{node.lineno}: {ast.unparse(node)}"
        for path in FILES
        for node in nodes(path, ("_text(", "open("))
        if isinstance(node, ast.Call) and is_text_of_no_encoding(node)
    ]
    assert result == []


MODULES_OF_POSIX = {"fcntl", "grp", "posix", "pty", "pwd", "resource", "syslog", "termios", "tty"}
NAMES_OF_POSIX = {"os.fork", "os.getuid", "os.geteuid", "os.killpg", "os.mkfifo", "os.setsid"}
NAMES_OF_POSIX |= {"signal.SIGALRM", "signal.SIGHUP", "signal.SIGKILL", "signal.SIGUSR1"}


def test_the_package_takes_nothing_that_windows_lacks():
    used = set()
    for path in (p for p in FILES if "tests" not in p.relative_to(ROOT).parts):
        for node in nodes(path, MODULES_OF_POSIX | {name.split(".")[1] for name in NAMES_OF_POSIX}):
            if isinstance(node, ast.Import):
                used |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                used |= {str(node.module)} | {f"{node.module}.{a.name}" for a in node.names}
            elif isinstance(node, ast.Attribute):
                used.add(ast.unparse(node))
    assert used & (MODULES_OF_POSIX | NAMES_OF_POSIX) == set()
