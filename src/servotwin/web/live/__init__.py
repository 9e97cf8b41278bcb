"""The bench behind the page, without any network: a text of its state, and servos that run under it in time."""

from servotwin.web.live.live_bench import LiveBench, Push, ServoPush
from servotwin.web.live.replay import Replayed, replay
from servotwin.web.live.scene import Scene, SceneServo, read_fragment, read_scene

__all__ = ["LiveBench", "Push", "Replayed", "Scene", "SceneServo", "ServoPush", "read_fragment", "read_scene", "replay"]
