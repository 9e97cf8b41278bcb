"""What hands do at the page: push, turn, type, choose, and shapes that go on by themselves."""

import math
import re

import pytest

from page_talk import angle, beside, come_to_rest, go_on, latest, opened_panel, scene

pytestmark = pytest.mark.slow


def test_a_horn_gives_way_to_the_mouse_and_says_the_force(page):
    go_on(page, 0.5)
    before = angle(page)
    box = page.locator("svg.servo0").bounding_box()
    _, top, _, tall = map(float, page.locator("svg.servo0").get_attribute("viewBox").split())
    x, y = box["x"] + box["width"] / 2, box["y"] - top / tall * box["height"]
    reach = 0.3 * box["width"]
    page.mouse.move(x, y - reach)
    page.mouse.down()
    page.mouse.move(x - reach, y, steps=8)  # a quarter turn, towards larger angles
    go_on(page, 0.4)
    come_to_rest(page)
    # words of a computer that cannot keep up move no horn under the hand
    page.evaluate("document.querySelector('.pace').textContent = 'only 370.2 ms in a second, or less'")
    assert page.locator("svg.servo0").bounding_box() == box
    # text and angle of one moment: on a busy machine the text comes a frame after the angle, and the horn swings
    page.wait_for_function("""(before) => {
        const said = /pushes with ([\\d.]+) mN m towards larger/.exec(document.querySelector('.force').textContent);
        const moved = bench.history[0].latest('output_angle') - before;
        const ahead = Math.PI / 2 - moved; // of the horn, where the hand is [rad]
        return said && moved > 0.09 && Math.abs(1e-3 * Number(said[1]) - 2.0 * ahead) < 0.15;
    }""", arg=math.radians(before))
    assert page.locator("svg.servo0 .hand").get_attribute("d").startswith("M")
    page.mouse.up()
    page.wait_for_function("document.querySelector('.force').textContent.startsWith('Turn')")
    go_on(page, 1.0)
    assert abs(angle(page) - before) < 5.0


def test_an_arrow_key_pushes_while_it_is_down(page):
    go_on(page, 0.5)
    before = angle(page)
    page.locator("svg.servo0").focus()
    page.keyboard.down("ArrowRight")
    go_on(page, 0.6)
    assert angle(page) < before - 0.5
    page.keyboard.up("ArrowRight")
    go_on(page, 1.0)
    pushes = [value for _, kind, value, *_ in scene(page)["actions"] if kind == "push"]
    assert len(pushes) == 2  # a key that repeats pushes once
    assert pushes[0] > 0.0 == pushes[1]


def test_wheel_typed_value_and_follow(page):
    field = page.get_by_label("pulse", exact=True)
    field.fill("1600")
    field.press("Enter")
    go_on(page, 0.3)
    assert latest(page, "pulse_width") == pytest.approx(1.6e-3, abs=1e-12)
    slide = page.get_by_label("pulse, slider")
    slide.focus()
    slide.hover()
    page.mouse.wheel(0, -100)
    page.mouse.wheel(0, -100)
    go_on(page, 0.3)
    assert latest(page, "pulse_width") == pytest.approx(1.602e-3, abs=1e-12)
    page.keyboard.press("ArrowRight")
    go_on(page, 0.3)
    assert latest(page, "pulse_width") == pytest.approx(1.603e-3, abs=1e-12)
    page.get_by_label("Shape").select_option("step")
    page.get_by_label("period (0: once)").fill("0")
    page.get_by_role("button", name="Begin the step").click()
    page.get_by_role("heading", name="Command").hover()
    page.wait_for_function("document.querySelector('.slider.main input[type=number]').value === '1800'", timeout=5000)


@pytest.mark.parametrize(("unit", "signal", "value", "si"), [
    ("deg", "command_angle", "75", 1.3089969389957472), ("V", "command_voltage", "1.2", 1.2)])
def test_a_command_in_degrees_and_in_volts(page, unit, signal, value, si):
    page.get_by_label("Told in").select_option(unit)
    field = page.locator(".slider.main input[type=number]")
    field.fill(value)
    field.press("Enter")
    go_on(page, 1.2)
    assert latest(page, signal) == pytest.approx(si, abs=1e-9)
    assert latest(page, "output_angle") == pytest.approx(latest(page, "command_angle"), abs=0.06)


SHAPES = [  # shape, what is typed, times after its beginning [s], and pulses then [us], to how many
    ("step", {"from": "1300", "to": "1700", "period (0: once)": "1"}, [0.3, 0.7], [1300.0, 1700.0], 1e-6),
    ("sine", {"mean": "1500", "amplitude": "100", "frequency": "1"}, [0.24, 0.74], [1600.0, 1400.0], 3.0),
    ("sweep", {"mean": "1500", "amplitude": "50", "from": "1"}, [0.25], [1550.0], 8.0),
    ("staircase", {"from": "1400", "to": "1500", "steps": "4", "each for": "0.2"}, [0.1, 0.3, 0.5],
     [1400.0, 1425.0, 1450.0], 1e-6),
    ("recorded", {}, [0.1, 0.5], [1450.0, 1550.0], 1e-6)]


def test_shapes_begin_and_go_as_they_are_told(page):
    for shape, fields, at, expected, slack in SHAPES:
        page.get_by_label("Shape").select_option(shape)
        for label, value in fields.items():
            page.locator(".shape").get_by_label(label, exact=True).fill(value)
        if shape == "recorded":
            page.locator(".shape textarea").fill("0, 1450\n0.4, 1550\n0.8; 1500")
        page.locator(".shape button").click()
        go_on(page, 0.1)
        start, kind, command = scene(page)["actions"][-1]
        assert (kind, command["shape"]) == ("command", shape)
        page.wait_for_function(f"bench.time > {start + at[-1] + 0.1}")
        for time, wanted in zip(at, expected, strict=True):
            edge, width = page.evaluate(f"bench.history[0].pulses({start + time - 0.02}, {start + time}).at(-1)")
            assert 1e6 * width == pytest.approx(wanted, abs=slack), (shape, edge)  # it is heard once a frame


def test_any_parameter_by_search_changes_the_servo(page):
    beside(page)
    opened_panel(page, "Any parameter")
    page.get_by_label("Search").fill("stretcher gain")
    assert page.locator(".found .card").count() == 1
    field = page.locator(".found .card input")
    before = float(field.input_value())
    page.evaluate("bench.do('set', {'load.torque': 0.5})")
    go_on(page, 1.0)
    droop = latest(page, "command_angle") - latest(page, "output_angle")
    field.fill(str(3 * before))
    field.press("Enter")
    go_on(page, 1.2)
    assert 0.0 < latest(page, "command_angle") - latest(page, "output_angle") < 0.6 * droop
    assert latest(page, "output_angle", 1) != latest(page, "output_angle", 0)  # of the first servo alone
    assert scene(page)["actions"][-1][1:] == ["set", {"electronics.stretcher_gain": 3 * before}, 0]


def test_supply_load_and_choices_have_their_controls(page):
    opened_panel(page, "Supply, chip and gear")
    volts = page.get_by_label("voltage without load", exact=True)
    volts.fill("4.8")
    volts.press("Enter")
    page.get_by_label("what the bridge does between drives").select_option("coast")
    ends = page.evaluate("bench.loads.find((one) => one.name === 'load.torque')")
    assert page.get_by_label(re.compile("^constant torque.*slider$")).count() == 1
    page.get_by_label("mass at the end of an arm", exact=True).fill("0.3")
    page.get_by_label("mass at the end of an arm", exact=True).press("Enter")
    go_on(page, 0.5)
    assert latest(page, "bus_voltage") == pytest.approx(4.8, abs=1e-9)
    assert (ends["low"], ends["high"]) == (-2.0, 2.0)
    page.wait_for_function("Number(document.querySelector('svg.servo0 .mass').getAttribute('r')) > 0")
    assert float(page.locator("svg.servo0 .mass").get_attribute("r")) == pytest.approx(
        (0.3 / (4 / 3 * 3.14159265 * 11340)) ** (1 / 3), rel=1e-3)
    done = [value for _, kind, value, *_ in scene(page)["actions"] if kind == "set"]
    assert done == [{"supply.open_circuit_voltage": 4.8}, {"electronics.off_state": "coast"},
                    {"load.pendulum.mass": 0.3}]


def test_a_register_is_stiffness(opened, home):
    page = opened(home)
    page.evaluate("""bench.ask({scene: 'format = 1\\n[[servo]]\\nid = "feetech-sts3215-12v"\\n'})""")
    page.wait_for_function("bench.facts[0].registers !== null")
    opened_panel(page, "Registers")
    said = page.locator(".stiffness strong")
    before = float(said.inner_text().split()[0])
    field = page.get_by_label(re.compile("^P_Coefficient"))
    assert field.input_value() == "32"
    field.fill("16")
    field.press("Enter")
    page.locator("h1").click()
    page.wait_for_function(f"parseFloat(document.querySelector('.stiffness strong').textContent) < {0.9 * before}")
    assert float(said.inner_text().split()[0]) == pytest.approx(0.5 * before, rel=0.01)
    assert "N m/rad" in said.inner_text()
    field.fill("300")
    field.press("Enter")
    page.wait_for_selector("#notice:not([hidden])")
    assert "P_Coefficient" in page.locator("#notice").inner_text()
    page.get_by_label("torque is on").uncheck()
    page.evaluate("bench.do('push', 1.5)")
    go_on(page, 0.5)
    assert latest(page, "output_angle") < -0.3  # it is let go


def test_a_gamepad_moves_the_command_while_its_stick_is_away_from_the_middle(page):
    page.evaluate("""() => { window.stick = 0.05; navigator.getGamepads = () => [null,
        { id: 'a gamepad', axes: [window.stick, 0] }]; }""")
    before = latest(page, "pulse_width")
    go_on(page, 0.3)
    assert latest(page, "pulse_width") == before  # a stick that does not quite come to rest
    page.evaluate("window.stick = -0.8")
    page.wait_for_function(f"{before} - bench.history[0].latest('pulse_width') > 5e-5")
    page.evaluate("window.stick = 0")
    page.evaluate("() => new Promise((seen) => requestAnimationFrame(() => requestAnimationFrame(seen)))")
    go_on(page, 0.3)
    moved = latest(page, "pulse_width")
    assert moved < before - 5e-5  # how far, the wall's clock says
    assert page.get_by_text("gamepad: a gamepad").is_visible()
    go_on(page, 0.2)
    assert latest(page, "pulse_width") == moved


def test_other_servos_are_chosen_and_their_curves_shown(page):
    opened_panel(page, "Servos")
    page.get_by_label("Servo 1", exact=True).select_option("feetech-sts3215-12v")
    page.locator(".curves h3", has_text="Feetech").wait_for()
    assert page.locator(".curve path.line").count() == 2
    assert "mN m at rest" in page.locator(".curve").get_attribute("aria-label")
    page.get_by_role("button", name="Add a servo").click()
    page.get_by_label("Servo 2", exact=True).select_option("dynamixel-xl330-m288")
    page.get_by_label("All on one battery").check()
    page.get_by_label("Voltage without load").last.fill("7.4")
    page.get_by_role("button", name="Put on the bench").click()
    page.wait_for_function("bench.facts[1]?.id === 'dynamixel-xl330-m288' && bench.history[1].length > 5")
    assert [one["model"] for one in page.evaluate("bench.facts")] == ["DigitalServo", "DigitalServo"]
    assert latest(page, "bus_voltage", 0) == latest(page, "bus_voltage", 1) == pytest.approx(7.4, abs=0.4)
    assert page.locator("figcaption").count() == 2
