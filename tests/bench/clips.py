"""Clips of a turning mark, drawn: tilt, lens, exposure, noise and codec as a phone has them."""

import struct
from dataclasses import dataclass, field

import cv2
import numpy as np

from servotwin.bench.video.marker import mark_cells

_SHARP = 3  # texture pixels in one of the picture's
_OVER = 2  # picture's pixels drawn a side, before they are averaged
_SAMPLES = 5  # of an exposure


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What is filmed: a disc with a mark that turns, before a blurred background that stands still."""

    side: float = 120.0  # pixels, where there is no tilt
    tilt: float = 15.0  # deg
    marks: tuple = ((0, (0.1, -0.05)),)  # id, and where its middle is [sides]
    still: tuple = ()  # marks on the case: id, left, top, pixels
    size: tuple = (400, 320)
    focal: float = 700.0  # pixels
    exposure: float = 1 / 60  # s
    noise: float = 4.0  # grey levels of 255
    lens: float = 0.7  # pixels
    readout: float = 0.0  # s from the first row to the last
    lamp: tuple = ()  # left, top, pixels, instant it goes on [s]
    shake: float = 0.0  # pixels
    background: np.ndarray = field(default=None, repr=False)


def mark_picture(mark, cell):
    """A mark with one cell of white around it."""
    cells = np.kron(np.pad(mark_cells(mark), 1, constant_values=True), np.ones((cell, cell)))
    return (30 + 200 * cells).astype(np.uint8)


def pictures(scene, angle, times, seed=0):
    """Pictures of a mark whose angle is a function of the time; times are those of the beginning of an exposure."""
    noise = np.random.default_rng(seed)
    width, height = scene.size
    rows = np.random.default_rng(1).normal(120, 25, (height // 16, width // 16)).astype(np.float32)
    ground = cv2.resize(rows, scene.size, interpolation=cv2.INTER_CUBIC)
    for mark, left, top, side in scene.still:
        drawn = cv2.resize(mark_picture(mark, 24), (side * 8 // 6,) * 2, interpolation=cv2.INTER_AREA)
        ground[top:top + drawn.shape[0], left:left + drawn.shape[1]] = drawn
    disc, to_disc = _disc(scene)
    plane = homography(scene)
    bands = 16 if scene.readout else 1
    for time in times:
        seen = np.empty((height, width), np.float32)
        for band in range(bands):
            first, last = band * height // bands, (band + 1) * height // bands
            start = time + scene.readout * (band + 0.5) / bands
            shown = 0.0
            for k in range(_SAMPLES):
                q = float(angle(start + scene.exposure * (k + 0.5) / _SAMPLES))
                turn = np.array([[np.cos(q), -np.sin(q), 0], [np.sin(q), np.cos(q), 0], [0, 0, 1]])
                shown = shown + _drawn(disc, plane @ turn @ np.linalg.inv(to_disc), ground, first, last) / _SAMPLES
            seen[first:last] = shown
        if scene.lamp:
            left, top, size, instant = scene.lamp
            share = np.clip((time + scene.exposure - instant) / scene.exposure, 0, 1)
            seen[top:top + size, left:left + size] = 60 + 190 * share
        if scene.shake:
            x, y = scene.shake * np.array([np.sin(9 * time), np.cos(7 * time)])
            seen = cv2.warpAffine(seen, np.array([[1, 0, x], [0, 1, y]]), scene.size, borderMode=cv2.BORDER_REFLECT)
        seen = cv2.GaussianBlur(seen, (0, 0), scene.lens) + noise.normal(0, scene.noise, seen.shape)
        yield cv2.cvtColor(np.clip(seen, 0, 255).astype(np.uint8), cv2.COLOR_GRAY2BGR)


def homography(scene):
    """From the plane, in sides and with the axis at its origin, to the picture."""
    lean = cv2.Rodrigues(np.radians(scene.tilt) * np.array([np.cos(0.6), np.sin(0.6), 0.0]))[0]
    pose = np.diag([1.0, -1.0, -1.0]) @ lean @ cv2.Rodrigues(np.array([0.0, 0.0, 0.35]))[0]
    lens = np.array([[scene.focal, 0, scene.size[0] / 2], [0, scene.focal, scene.size[1] / 2], [0, 0, 1]])
    return lens @ np.column_stack([pose[:, 0], pose[:, 1], [0, 0, scene.focal / scene.side]])


def corners(scene, angle):
    """Where the corners of the first mark are at an angle, shape (4, 2)."""
    c, s = np.cos(angle), np.sin(angle)
    square = (np.array([[-0.5, 0.5], [0.5, 0.5], [0.5, -0.5], [-0.5, -0.5]]) + scene.marks[0][1]) @ [[c, s], [-s, c]]
    seen = np.column_stack([square, np.ones(4)]) @ homography(scene).T
    return seen[:, :2] / seen[:, 2:]


def film(path, scene, angle, times, *, rate=30.0, codec="mp4v", seed=0):
    """Write a clip; return its path."""
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*codec), rate, scene.size)
    assert writer.isOpened()
    for picture in pictures(scene, angle, times, seed):
        writer.write(picture)
    writer.release()
    return path


def _disc(scene):
    """The texture that turns, and the map to it from the plane [sides]."""
    cell = max(2, round(scene.side * _SHARP / 6))
    n = 2 * round(cell * (4.5 + 6 * max((abs(c) for _, at in scene.marks for c in at), default=0.0)))
    disc = np.full((n, n), 150, np.uint8)
    for mark, (x, y) in scene.marks:
        drawn = mark_picture(mark, cell)
        left, top = round(n / 2 + 6 * cell * x) - 4 * cell, round(n / 2 - 6 * cell * y) - 4 * cell
        disc[top:top + 8 * cell, left:left + 8 * cell] = drawn
    return disc, np.array([[6 * cell, 0, n / 2 - 0.5], [0, -6 * cell, n / 2 - 0.5], [0, 0, 1]])


def _drawn(disc, plane, ground, first, last):
    """The rows first to last of a picture, without lens and noise."""
    finer = np.array([[_OVER, 0, 0.5 * (_OVER - 1)], [0, _OVER, 0.5 * (_OVER - 1) - _OVER * first], [0, 0, 1.0]])
    width = ground.shape[1]
    size = (width * _OVER, (last - first) * _OVER)
    seen, there = (cv2.resize(cv2.warpPerspective(one, finer @ plane, size, flags=how), (width, last - first),
                              interpolation=cv2.INTER_AREA).astype(np.float32)
                   for one, how in ((disc, cv2.INTER_LINEAR), (np.full_like(disc, 255), cv2.INTER_NEAREST)))
    return seen + (1.0 - there / 255.0) * ground[first:last]


def with_times(clip, steps):
    """Give the pictures of an mp4 other intervals [1/90000 s], as phones do, in its table `stts`."""
    ticks = sum(steps)

    def rebuilt(data):
        made, at = b"", 0
        while at < len(data):
            size, kind = struct.unpack(">I4s", data[at:at + 8])
            body = data[at + 8:at + size]
            if kind in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
                body = rebuilt(body)
            elif kind == b"stts":
                body = struct.pack(">II", 0, len(steps)) + b"".join(struct.pack(">II", 1, step) for step in steps)
            elif kind == b"mdhd":
                body = body[:12] + struct.pack(">II", 90000, ticks) + body[20:]
            elif kind == b"edts":  # says how long the clip was before
                kind = b"free"
            made += struct.pack(">I4s", len(body) + 8, kind) + body
            at += size
        return made

    data = clip.read_bytes()
    assert data.rindex(b"moov") > data.rindex(b"mdat")  # or places of pictures would move
    clip.write_bytes(rebuilt(data))
    return clip


def cut_in_front(clip, share):
    """Move the table of an mp4 before its pictures, as phones that stream do, and cut the file."""
    data = clip.read_bytes()
    at, boxes = 0, {}
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        boxes[kind] = data[at:at + size]
        at += size
    table = bytearray(boxes[b"moov"])
    place = table.index(b"stco") + 8
    for k in range(struct.unpack(">I", table[place:place + 4])[0]):
        here = place + 4 + 4 * k
        table[here:here + 4] = struct.pack(">I", struct.unpack(">I", table[here:here + 4])[0] + len(table))
    rest = b"".join(box for kind, box in boxes.items() if kind not in (b"ftyp", b"moov"))
    made = boxes[b"ftyp"] + bytes(table) + rest
    clip.write_bytes(made[:int(share * len(made))])
    return clip
