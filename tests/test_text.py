"""Free text on its way in and out: names mean nothing where they are written, and what no reader sees stays out."""

import shutil
import subprocess
from xml.etree import ElementTree as Xml

import pytest

import servotwin as st
from servotwin import text
from servotwin.errors import HIDDEN, InputError
from servotwin.look import axes_grid, context, to_bytes

CODE = "void __attribute__((constructor)) planted(void) { *(volatile int *)0 = 0; }"
NAMES = {  # what would end a comment of C, or go on with it on the next line
    "an end": f"*/ {CODE} /*", "lines": f"*/\n{CODE}\n/*", "an end of two": f"*/*/{CODE}/*", "a beginning": "/* /* //*",
    "three in a row": f"**//*/*/ {CODE}", "a trigraph": "name ??/", "trigraphs": f"????/ ???/ {CODE} ??/",
    "a backslash": "name \\", "backslashes": "name \\\\ \\", "a directive": '\n#include "/etc/passwd"\n',
    "nul": f"a\0*/{CODE}", "carriage return": f"a\r*/{CODE}\r", "vertical": f"a\v\f\x85\u2028*/{CODE}", "none": ""}


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("flags", [(), ("-trigraphs",)])
def test_a_comment_of_c_ends_where_it_ends(flags, tmp_path):
    lines = [f"/* {words} */ int at_{k}; /*{words}*/\n/* of\n * {words}\n */"
             for k, words in enumerate(map(text.c_comment, NAMES.values()))]
    source = tmp_path / "names.c"
    source.write_text("\n".join([*lines, "int main(void) { return 0; }", ""]))
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-Wcomment", "-pedantic", *flags]
    subprocess.run([*command, "-o", str(tmp_path / "names"), str(source)], check=True)
    subprocess.run([str(tmp_path / "names")], check=True)
    seen = subprocess.run(["gcc", "-E", "-P", *flags, str(source)], check=True, capture_output=True, text=True).stdout
    assert seen.split() == [word for k in range(len(NAMES)) for word in ("int", f"at_{k};")] + (
        "int main(void) { return 0; }".split())


@pytest.mark.parametrize("name", [
    *NAMES.values(), "../../x", "/etc/passwd", "CON", "nul.txt", "e\u0301", "n" * 10_000, ".hidden", "", "日本", "a b"])
def test_names_of_files_and_functions(name, tmp_path):
    stem, own = text.file_stem(name), text.identifier(name)
    (tmp_path / f"{stem}.toml").write_text("")
    assert [path.name for path in tmp_path.iterdir()] == [f"{stem}.toml"]
    assert own.isidentifier()
    assert own.isascii()
    assert not text.is_taken(own)
    assert stem.partition(".")[0].lower() not in ("con", "nul")
    assert max(len(stem), len(own)) <= 90


def test_files_of_different_names_are_different_files():
    names = ["a/b", "a_b", "A b", "a b", "", "..", "n" * 100, "n" * 101]
    stems = text.file_stems(names)
    assert list(stems) == names
    assert len({stem.casefold() for stem in stems.values()}) == len(names)


@pytest.mark.parametrize("hidden", [
    "\0", "\x1b", "\n", "\x7f", "\x9b", "\u061c", "\u200f", "\u2028", "\u202e", "\u2066", "\ud800", "\uffff"])
def test_what_no_reader_sees(hidden):
    """Control characters of C0 and C1, line ends, what turns the direction, half a character, none."""
    name = f"a{hidden}b"
    assert f"U+{ord(hidden):04X}" in text.fault_of(name)
    with pytest.raises(InputError, match=r"arm\.xml: joint: got 'a"):
        text.checked_name("arm.xml: joint", name)
    for out in (text.one_line(name), text.escape(name), text.c_comment(name), text.shown(name)):
        assert not HIDDEN.search(out.replace("\n", ""))
    Xml.fromstring(f"<a>{text.escape(name)}</a>")


@pytest.mark.parametrize("name", [
    "a", "Hitec HS-755HB (6 V)", "日本 サーボ", "größer 50 Ω", "🦾", "a\u00a0b\u200db", "$5"])
def test_what_is_read_as_it_is(name):
    assert text.fault_of(name) == ""
    assert st.servo_from_values(name, {}).name == name


@pytest.mark.parametrize(("name", "file_format"), [
    ("$\\frac{$", "png"), ("$a$ and $b$", "pdf"), ("\\$5", "svg"), ("a\x1b[0m\0b\u202e", "svg"),
    ("%s{0} & <b>--", "svg")])
def test_a_figure_has_the_letters_of_a_name(name, file_format):
    figure, (ax,) = axes_grid(1)
    with context():
        ax.plot([0.0, 1.0], [0.0, 1.0], label=name)
        ax.set_title(name)
        ax.legend()
        ax.set_ylabel("angle $q$ (°)", parse_math=True)
    content = to_bytes(figure, file_format)
    assert ax.get_title() == text.shown(name)
    if file_format == "svg":
        Xml.fromstring(content)


LONG = ["a"] * 40_000


@pytest.mark.parametrize("deep", [
    f"{'.'.join(LONG)} = 1", f"[{'.'.join(LONG)}]", f"x = {{{'.'.join(LONG)} = 1}}",
    '"a" . ' * 40_000 + "a = 1", "'a'." * 40_000 + "a = 1", 'x = "\\""\n' + ".".join(LONG), "a." * 16 + "a = 1",
    'x = {a = """q"""", ' + ".".join(LONG) + " = 1}", "x = {a = '''q''''', " + ".".join(LONG) + " = 1}",
    "x = " + "[" * 40_000, "x = " + "{a = " * 17 + "1" + "}" * 17])
def test_keys_of_toml_that_are_too_deep_are_refused_before_they_are_read(deep):
    """They took 30 s of a core, which grows with the square of the parts."""
    with pytest.raises(ValueError, match="nested too deeply, in more than 16 tables"):
        text.load_toml(deep)


@pytest.mark.parametrize("wrong", ["x = '''\n" * 20_001, 'x = """' + '\\"""' * 10_000, "x"])
def test_what_is_no_toml(wrong):
    with pytest.raises(ValueError, match=r"\(at (line|end)"):
        text.load_toml(wrong)


@pytest.mark.parametrize(("written", "read"), [
    ("a.b.c = 1.5", {"a": {"b": {"c": 1.5}}}), ('x = """"q""""" # a', {"x": '"q""'}),
    ('x = "a.b.c.d.e.f.g.h.i.j = 1"', {"x": "a.b.c.d.e.f.g.h.i.j = 1"}),
    ("x = 'a.b.c.d.e.f.g.h.i.j'", {"x": "a.b.c.d.e.f.g.h.i.j"}), ("# a.b.c.d.e.f.g.h.i.j\nx = 1", {"x": 1}),
    ('x = """\na.b.c.d.e.f.g.h.i.j\n"""', {"x": "a.b.c.d.e.f.g.h.i.j\n"}),
    ("x = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]", {"x": [k / 10 for k in range(1, 11)]}),
    ('x = "\\"" # "\ny = 2', {"x": '"', "y": 2})])
def test_toml_of_texts_with_dots(written, read):
    assert text.load_toml(written) == read
