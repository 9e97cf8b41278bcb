"""Each lesson opens from its link and shows what its text says; a pupil solves a mystery with what the page shows."""

import math

import pytest

from page_talk import go_on, opened_panel, pause, scene, until
from servotwin.web.lessons import lessons as taught

pytestmark = pytest.mark.slow

LINE = """(of) => { const [servo, name, from, to] = of; const found = bench.history[servo].slice(name, from, to);
    return [Array.from(found.time), Array.from(found.value)]; }"""


class Shown:
    """What the traces of a page show."""

    def __init__(self, page) -> None:
        self.page = page

    def angles(self, servo: int, start: float, end: float) -> list[float]:
        """Return angles between two times [deg]."""
        return [math.degrees(value) for value in self.values(servo, "output_angle", start, end)]

    def at(self, servo: int, time: float) -> float:
        """Return the angle at a time [deg]."""
        return self.angles(servo, time - 0.01, time)[-1]

    def values(self, servo: int, name: str, start: float, end: float) -> list[float]:
        """Return a signal between two times (SI)."""
        return self.page.evaluate(LINE, [servo, name, start, end])[1]


def deadband(seen: Shown) -> None:
    assert seen.at(0, 2.0) == pytest.approx(seen.at(0, 0.9), abs=1e-6)
    assert not any(seen.values(0, "armature_voltage", 0.5, 2.0))  # no drive at all
    assert seen.at(0, 6.0) > seen.at(0, 0.9) + 0.5


def droop(seen: Shown) -> None:
    assert seen.at(0, 2.9) == pytest.approx(seen.at(0, 0.9), abs=1e-6)
    assert seen.at(0, 4.9) - 1.0 > seen.at(0, 6.9) > seen.at(0, 8.9) + 1.0


def frames(seen: Shown) -> None:
    assert seen.at(0, 3.0) < 100.0 < 114.0 < seen.at(0, 7.0)
    assert seen.at(0, 11.0) > 114.0


def brake_or_coast(seen: Shown) -> None:
    assert max(seen.angles(0, 2.0, 3.4)) < 120.0 < 123.0 < max(seen.angles(1, 2.0, 3.4))


def vibration(seen: Shown) -> None:
    restless = seen.angles(0, 2.0, 3.9)
    assert max(restless) - min(restless) > 1.0
    assert max(restless) < 85.0
    assert seen.at(0, 6.0) == pytest.approx(90.0, abs=1.5)


def brown_out(seen: Shown) -> None:
    assert seen.at(0, 1.8) == pytest.approx(30.0, abs=2.0)
    assert max(seen.at(0, 4.9), seen.at(1, 4.9)) < 25.0
    assert min(seen.values(0, "bus_voltage", 3.4, 4.0)) < 3.6
    assert min(seen.at(0, 7.5), seen.at(1, 7.5)) > 28.0


def play(seen: Shown) -> None:
    still, loose = seen.angles(0, 1.0, 4.9), seen.angles(1, 1.0, 4.9)
    assert max(still) - min(still) < 0.1
    assert max(loose) - min(loose) > 1.2


def p_gain(seen: Shown) -> None:
    assert seen.at(0, 3.9) < -1.5 < seen.at(1, 3.9) < -0.5
    seen.page.get_by_role("heading", name="Registers").click()
    said = seen.page.locator(".stiffness strong").all_inner_texts()
    assert [float(one.split()[0]) for one in said] == pytest.approx([8.1, 32.3], abs=0.1)  # as the answer says


CLAIMS = {"deadband": (6.1, deadband), "droop": (9.0, droop), "frames": (11.1, frames),
          "brake-or-coast": (3.5, brake_or_coast), "vibration": (6.1, vibration), "brown-out": (7.6, brown_out),
          "play": (5.0, play), "p-gain": (4.0, p_gain)}


@pytest.mark.parametrize("lesson", taught.lessons(), ids=lambda lesson: lesson.name)
def test_a_lesson_opens_from_its_link_and_shows_what_it_says(opened, home, lesson):
    page = opened(f"{home}#lesson={lesson.name}", ready=".lesson h2")
    assert page.locator(".lesson h2").inner_text() == lesson.title
    assert page.locator(".lesson p:not(.answer)").all_inner_texts() == [*lesson.look, lesson.question]
    assert not page.locator(".answer").is_visible()
    page.get_by_role("button", name="Answer").click()
    assert page.locator(".answer").inner_text() == lesson.answer
    end, claim = CLAIMS[lesson.name]
    page.locator("#clock select").select_option("10")
    until(page, end)
    claim(Shown(page))


def test_lessons_are_listed_and_one_follows_the_other(page):
    opened_panel(page, "Lessons")
    links = page.locator(".side.lessons ol a")
    assert links.all_inner_texts() == [lesson.title for lesson in taught.lessons()]
    for k in (0, links.count() - 1):
        links.nth(k).click()
        page.wait_for_function(f"bench.state.name !== '' && location.hash === '#lesson={taught.lessons()[k].name}'")
        page.locator(".lesson h2", has_text=taught.lessons()[k].title).wait_for()


# --- the mystery servo ------------------------------------------------------------------------------------------------


class Pupil:
    """Who has the page, and nothing else."""

    def __init__(self, page) -> None:
        self.page = page

    def send(self, width: float) -> None:
        """Type a pulse [us], and wait until the servo has answered."""
        field = self.page.get_by_label("pulse", exact=True)
        field.fill(f"{width:g}")
        field.press("Enter")
        go_on(self.page, 0.07)
        self.page.wait_for_timeout(150)

    def reads(self, name: str, channel: int) -> float:
        """Return a measure of the oscilloscope."""
        row = self.page.locator(f".measures .channel{channel} div", has_text=name)
        value, unit = row.locator("dd").inner_text().split()
        return float(value) * {"m": 1e-3, "µ": 1e-6}.get(unit[0], 1.0)

    def drives(self) -> bool:
        """Tell whether the bridge of the servo drives: the second channel shows it."""
        return max(self.reads("highest", 2), -self.reads("lowest", 2)) > 1.0

    def edge(self, width: float, drives: bool) -> float:
        """Widen the pulse [us] until the bridge drives, or no longer does; return where that begins, to 0.25 us."""
        self.send(width)
        assert self.drives() != drives
        for step, wanted in ((3.0, drives), (-0.5, not drives)):  # in large steps there, in small ones back
            for _ in range(40):
                if self.drives() == wanted:
                    break
                width += step
                self.send(width)
        assert self.drives() != drives
        return width + 0.25


def test_a_pupil_finds_deadband_and_resistance_of_a_mystery_servo(opened, home):
    page = opened(home)
    opened_panel(page, "Mystery servo")
    page.get_by_label("Seed").fill("841")
    page.get_by_role("button", name="Begin", exact=True).click()
    page.wait_for_function("bench.state.unknowns.length > 0 && bench.history[0].length > 5")
    assert scene(page)["servo"] == [{"mystery": 841, "model": "PulseServo"}]
    assert page.evaluate("bench.facts[0].parameters.some((one) => one.name === 'electronics.deadband')") is False
    page.get_by_label("Time base").select_option("0.002")  # one frame
    pupil = Pupil(page)
    pupil.send(1600.0)
    go_on(page, 1.5)
    pupil.send(1500.0)
    go_on(page, 1.5)
    below = pupil.edge(1500.0, drives=False)  # its drives are too short to move it
    width = pupil.edge(below + 1.0, drives=True) - below
    page.get_by_label("constant torque; positive pushes towards smaller angles", exact=True).fill("400")
    page.get_by_label("constant torque; positive pushes towards smaller angles", exact=True).press("Enter")
    page.locator("summary", has_text="Channels and trigger").click()
    page.get_by_label("Channel 1", exact=True).select_option("0:armature_current")
    page.get_by_label("Trigger level").fill("0.3")
    go_on(page, 1.5)
    pause(page)
    ohms = pupil.reads("highest", 2) / pupil.reads("highest", 1)  # of a motor that stood when it was switched on
    answers = {"electronics.deadband": width, "motor.armature_resistance": ohms}
    for name, value in answers.items():
        page.locator(".lesson-panel").get_by_label(name).fill(f"{value:.6g}")
    page.get_by_role("button", name="Compare with the truth").click()
    page.wait_for_selector(".lesson-panel table")
    rows = {row.locator("th").inner_text(): row.locator("td").last.inner_text()
            for row in page.locator(".lesson-panel tr").all()}
    assert [rows[name] for name in answers] == ["found", "found"]
    assert [said for name, said in rows.items() if name not in answers] == ["not guessed"] * 3
