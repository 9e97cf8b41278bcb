import subprocess
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import servotwin as st
from servotwin import plotting
from servotwin.errors import InputError, OutputError, OutputExistsError, UnknownNameError


@pytest.fixture(scope="module")
def result(servo):
    command = st.signals.step(0.0, 90.0, at=0.1, unit="deg")
    return st.simulate(st.BoundedServo(servo), command, duration=0.8)


@pytest.mark.long
def test_nothing_is_loaded_before_it_is_needed():
    code = ("import sys, servotwin, servotwin.plotting; assert 'matplotlib' not in sys.modules; "
            "servotwin.plotting.axes_grid(); assert 'matplotlib.pyplot' not in sys.modules")
    subprocess.run([sys.executable, "-c", code], check=True)


def test_default_panels_carry_units(result):
    figure = plotting.time_response(result)
    labels = [ax.get_ylabel() for ax in figure.axes]
    assert [label.split("\n")[0] for label in labels] == [
        "output angle", "output speed", "armature voltage", "armature current"]
    assert all("(" in label for label in labels)
    assert figure.axes[-1].get_xlabel() == "time (s)"


def test_values_are_shown_in_degrees_and_microseconds(result):
    figure = plotting.time_response(result, ["output_angle", "pulse_width"])
    drawn = figure.axes[0].get_lines()[-1].get_ydata()
    np.testing.assert_allclose(drawn, np.degrees(result["output_angle"]), rtol=1e-12)
    width = figure.axes[1].get_lines()[-1].get_ydata()
    np.testing.assert_allclose(width, 1e6 * result["pulse_width"], rtol=1e-12)


def test_a_motor_has_its_own_panels(servo):
    run = st.simulate(st.DCMotor(servo), st.signals.constant(3.0, unit="V"), duration=0.1)
    assert len(plotting.time_response(run).axes) == 4


def test_one_name_is_enough(result):
    assert len(plotting.time_response(result, "output_speed").axes) == 1


def test_unknown_signals_are_refused(result):
    with pytest.raises(UnknownNameError, match="output_angle"):
        plotting.time_response(result, ["output_angel"])
    with pytest.raises(InputError):
        plotting.time_response(result, [])
    with pytest.raises(InputError, match="what simulate returns"):
        plotting.time_response("x")


@pytest.mark.long(but="png")
@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_files_are_the_same_every_time(tmp_path, result, ending):
    first, second = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    plotting.save(plotting.time_response(result), first)
    plotting.save(plotting.time_response(result), second)
    assert first.read_bytes() == second.read_bytes()
    assert first.stat().st_size > 2000
    assert not list(tmp_path.glob(".*"))


def test_svg_is_valid_and_without_date(result):
    text = plotting.to_bytes(plotting.time_response(result), "svg")
    ElementTree.fromstring(text)
    assert b"dc:date" not in text


def test_save_says_what_is_wrong(tmp_path, result):
    figure = plotting.time_response(result, ["output_angle"])
    target = tmp_path / "a.png"
    target.write_text("mine")
    with pytest.raises(OutputExistsError):
        plotting.save(figure, target)
    assert target.read_text() == "mine"
    plotting.save(figure, target, overwrite=True)
    assert target.read_bytes().startswith(b"\x89PNG")
    for bad in (tmp_path / "a.jpg", tmp_path / "a", tmp_path / "missing" / "a.png", target / "b.png"):
        with pytest.raises(OutputError):
            plotting.save(figure, bad)


@pytest.mark.parametrize("number", [2, 4, 5, 6, 8])
def test_block_diagrams(number):
    figure = plotting.block_diagram(number)
    assert len(figure.axes[0].patches) >= 3
    assert plotting.to_bytes(figure, "png").startswith(b"\x89PNG")


def test_block_diagrams_of_other_numbers_are_refused():
    with pytest.raises(InputError, match="2, 4, 5, 6, 8"):
        plotting.block_diagram(3)


@pytest.mark.long(but="4")
@pytest.mark.parametrize("number", [2, 4, 5, 6, 8])
def test_labels_of_block_diagrams_do_not_overlap(number):
    figure = plotting.block_diagram(number)
    figure.canvas.draw()
    boxes = [text.get_window_extent() for text in figure.axes[0].texts if text.get_text()]
    for k, one in enumerate(boxes):
        assert not any(one.overlaps(other) for other in boxes[k + 1:]), figure.axes[0].texts[k].get_text()


def test_curves_and_pulses():
    curve = plotting.Curve("a", [0.0, 1.0], [0.0, 1.0])
    figure = plotting.curves([curve, curve._replace(points=True, error=[0.1, 0.1])], x_label="x (1)", y_label="y (1)",
                             below=[curve], below_label="d (1)", limits=[plotting.Limit("most", 0.9)])
    assert len(figure.axes) == 2
    with pytest.raises(InputError):
        plotting.curves([], x_label="x", y_label="y")
    with pytest.raises(InputError):
        plotting.pulses([0.0], [1e-3], frame_period=0.02)


def test_dashes_differ_for_grey_print():
    assert len({str(dash) for _, dash in plotting.LINES}) == len(plotting.LINES)


def test_formula():
    made = plotting.formula_svg(r"$\dfrac{k_a}{s}$")
    ElementTree.fromstring(made.svg)
    assert made.width > 0.0
    with pytest.raises(ValueError, match="Expected"):
        plotting.formula_svg(r"$\dfrac{k_a$")


def test_points_that_come_later_lie_in_front():
    """The measured points of the paper's figures 25 to 27 were hidden by the simulated ones."""
    drawn = [plotting.Curve(label, [0.0, 1.0], [0.0, 1.0], points=True, style=style)
             for label, style in (("simulated", 3), ("measured", 0))]
    figure = plotting.curves(drawn, x_label="x", y_label="y")
    heights = [container.lines[0].get_zorder() for container in figure.axes[0].containers]
    assert heights[0] < heights[1]
