"""LeRobot's own code at a port, without torch: `python wire_lerobot.py bus|arm PORT FOLDER`.

Of what it does not need here there are empty modules. Prints what it found as JSON.
"""

import importlib.machinery
import json
import sys
import time
import types
from pathlib import Path

PATIENCE = 500.0  # ms
MOVING = 8.0  # s for which a hand moves the arm


class Anything:
    """Whatever a module is asked for."""

    def __init__(self, *_, **__):
        pass

    def __class_getitem__(cls, _):
        return cls


def stub(name, **given):
    module = types.ModuleType(name)
    module.__spec__ = importlib.machinery.ModuleSpec(name, None, is_package=True)
    module.__path__ = []
    module.__getattr__ = lambda attribute: Anything if not attribute.startswith("__") else None
    for key, value in given.items():
        setattr(module, key, value)
    sys.modules[name] = module


for name in ("torch", "accelerate", "datasets", "datasets.utils", "datasets.utils.logging", "huggingface_hub",
             "huggingface_hub.constants", "huggingface_hub.errors"):
    stub(name)


def patient(bus):
    """Let answers be late: LeRobot waits for 50 ms, and on a machine that is busy others have the processor."""
    bus.port_handler.setPacketTimeout = lambda length: bus.port_handler.setPacketTimeoutMillis(PATIENCE)
    return bus


def of_bus(port, folder):
    from lerobot.motors import Motor, MotorCalibration, MotorNormMode
    from lerobot.motors.feetech import FeetechMotorsBus, OperatingMode

    names = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
    motors = {name: Motor(id, "sts3215", MotorNormMode.DEGREES) for id, name in enumerate(names, start=1)}
    bus = patient(FeetechMotorsBus(port, motors))
    bus.connect()
    bus.disable_torque()
    for name in names:
        bus.write("Operating_Mode", name, OperatingMode.POSITION.value)
    offsets = bus.set_half_turn_homings()
    homed = bus.sync_read("Present_Position", normalize=False)
    calibration = {name: MotorCalibration(id=motors[name].id, drive_mode=0, homing_offset=offsets[name], range_min=700,
                                          range_max=3400) for name in names}
    bus.write_calibration(calibration)
    with bus.torque_disabled():
        bus.configure_motors()
        for name in names:
            bus.write("P_Coefficient", name, 16)
            bus.write("I_Coefficient", name, 0)
            bus.write("D_Coefficient", name, 32)
    calibrated, lost, began = bus.is_calibrated, 0, time.perf_counter()
    goals = dict.fromkeys(names, 10.0)
    for _ in range(300):
        try:
            bus.sync_read("Present_Position")
        except ConnectionError:
            lost += 1
        bus.sync_write("Goal_Position", goals)
        time.sleep(0.002)
    took = time.perf_counter() - began
    time.sleep(1.5)
    reached = bus.sync_read("Present_Position", num_retry=5)
    found = {"homed": homed, "calibrated": calibrated, "reached": reached, "lost": lost, "took": took,
             "ids": bus.broadcast_ping()}
    bus.disconnect()
    again = patient(FeetechMotorsBus(port, motors, calibration))
    again.connect()
    found["again"] = again.is_calibrated
    again.disconnect()
    return found


def of_arm(port, folder):
    stub("lerobot.processor", RobotAction=dict, RobotObservation=dict)
    stub("lerobot.cameras", CameraConfig=object)
    stub("lerobot.cameras.utils", make_cameras_from_configs=lambda configs: {})
    stub("lerobot.utils.constants", HF_LEROBOT_CALIBRATION=Path(folder), HF_LEROBOT_HOME=Path(folder), ROBOTS="robots",
         TELEOPERATORS="teleoperators")
    import builtins

    from lerobot.motors import motors_bus
    from lerobot.robots.so_follower import SO101Follower, SO101FollowerConfig

    end = time.monotonic() + MOVING
    builtins.input = lambda prompt="": ""
    motors_bus.enter_pressed = lambda: time.monotonic() > end
    robot = SO101Follower(SO101FollowerConfig(port=port, id="twin"))
    patient(robot.bus)
    robot.connect(calibrate=True)
    seen = robot.get_observation()
    robot.send_action(dict.fromkeys((f"{name}.pos" for name in robot.bus.motors), 5.0))
    time.sleep(1.5)
    reached = robot.get_observation()
    calibration = {name: [one.range_min, one.range_max, one.homing_offset] for name, one in robot.calibration.items()}
    robot.disconnect()
    return {"seen": seen, "reached": reached, "calibration": calibration}


if __name__ == "__main__":
    what, port, folder = sys.argv[1:]
    print("\n" + json.dumps({"bus": of_bus, "arm": of_arm}[what](port, folder)))
