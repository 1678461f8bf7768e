"""What TypeScript finds in the page's modules: types, names, imports, arguments, unused names."""

from __future__ import annotations

import re
from pathlib import Path

from tests.support.processes import ROOT, need, run_program

PAGE = ROOT / "services" / "zv" / "viewer" / "page" / "js"
LINE = re.compile(r"^(\S+)\(\d+,\d+\): error TS(\d+): (.*)$", re.MULTILINE)
OPTIONS = (
    "--noEmit", "--allowJs", "--checkJs", "--strict", "--noImplicitAny", "false",
    "--noUncheckedIndexedAccess", "--noUnusedLocals", "--noUnusedParameters", "--noImplicitReturns",
    "--noFallthroughCasesInSwitch", "--noImplicitOverride", "--allowUnreachableCode", "false",
    "--target", "esnext", "--module", "esnext", "--moduleResolution", "node",
    "--lib", "esnext,dom,dom.iterable", "--skipDefaultLibCheck",
)  # fmt: skip


def test_the_modules_have_no_fault_and_each_kind_of_fault_would_be_found(tmp_path: Path):
    texts = {
        "export const a = missing;": "2304",
        'import { another } from "./other.js"; another();': "2305",
        'import { one } from "./nowhere.js"; one();': "2307",
        'import { one } from "./other.js"; export const a = 1;': "6133",
        'import { one } from "./other.js"; one(1, 2);': "2554",
        "export function f() { const unused = 1; }": "6133",
        "const a = 1; a = 2; export { a };": "2588",
        "export class A { constructor() { this.b = 1; } c() { return this.d; } }": "2339",
        'export const a = "text" * 2;': "2362",
        "Math.abs('text'); export {};": "2345",
        "export function f(a) { if (a) return 1; }": "7030",
        "export const a = [1].find(Boolean) + 1;": "2532",
        "export const a = ['x'].map(String)[1].length;": "2532",
    }
    (tmp_path / "other.js").write_text("export function one(first) { return first; }")
    wrong = [tmp_path / f"module{number}.js" for number in range(len(texts))]
    for module, text in zip(wrong, texts, strict=True):
        module.write_text(text)
    known = Path(__file__).with_name("browser.d.ts")
    modules = [known, *sorted(PAGE.rglob("*.js")), *wrong]
    done = run_program([need("tsc", "node-typescript"), *OPTIONS, *modules], folder=ROOT)
    found = LINE.findall(done.stdout)
    assert found, done.stdout + done.stderr
    assert [fault for fault in found if (ROOT / fault[0]).is_relative_to(PAGE)] == []
    codes = {(ROOT / file).resolve(): code for file, code, _ in found}
    assert codes == {module: texts[module.read_text()] for module in wrong}
