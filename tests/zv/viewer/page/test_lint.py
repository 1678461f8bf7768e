"""What TypeScript finds in the page's modules: names, imports, arguments, what nobody uses."""

from __future__ import annotations

import re
from pathlib import Path

from tests.support.processes import ROOT, need, run_program

PAGE = ROOT / "services" / "zv" / "viewer" / "page" / "js"
LINE = re.compile(r"^(\S+)\(\d+,\d+\): error TS(\d+): (.*)$", re.MULTILINE)
NOT_JUDGED = {
    # Properties: classes get theirs by Object.assign, and elements are found by their ids.
    "2339", "2551",
    # Types of values, which no comment declares.
    "2345", "2349", "2362", "2363", "2464", "2525", "2531", "2538", "2769",
}  # fmt: skip
OPTIONS = (
    "--noEmit", "--allowJs", "--checkJs", "--noUnusedLocals", "--noUnusedParameters",
    "--target", "esnext", "--module", "esnext", "--moduleResolution", "node",
    "--lib", "esnext,dom,dom.iterable",
)  # fmt: skip


def faults(*modules: Path) -> list[tuple[str, str, str]]:
    """Return the file, the code and the text of each error that is judged."""
    known = Path(__file__).with_name("browser.d.ts")
    done = run_program([need("tsc", "node-typescript"), *OPTIONS, known, *modules], folder=ROOT)
    found = LINE.findall(done.stdout)
    assert done.returncode == 0 or found, done.stdout + done.stderr
    return [fault for fault in found if fault[1] not in NOT_JUDGED]


def test_the_modules_have_no_fault_that_can_be_judged_without_declared_types():
    assert faults(*sorted(PAGE.rglob("*.js"))) == []


def test_each_kind_of_fault_is_found(tmp_path: Path):
    texts = {
        "export const a = missing;": "2304",
        'import { another } from "./other.js"; another();': "2305",
        'import { one } from "./nowhere.js"; one();': "2307",
        'import { one } from "./other.js"; export const a = 1;': "6133",
        'import { one } from "./other.js"; one(1, 2);': "2554",
        "export function f() { const unused = 1; }": "6133",
        "const a = 1; a = 2; export { a };": "2588",
    }
    (tmp_path / "other.js").write_text("export function one(first) { return first; }")
    modules = [tmp_path / f"module{number}.js" for number in range(len(texts))]
    for module, text in zip(modules, texts, strict=True):
        module.write_text(text)
    found = {Path(file).name: code for file, code, _ in faults(*modules)}
    assert found == {module.name: texts[module.read_text()] for module in modules}
