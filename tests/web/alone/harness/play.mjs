// Lets benches of the page as one file go on, in node or in a browser; returns what shows of each.

export function play({ Kernel, Live, Refused, read, written, speak }, module, world, jobs, now) {
  speak(world.words);
  const kernel = new Kernel(module, world.layout);
  return jobs.map(({ scene, steps, rate, switches }) => {
    const refused = [];
    let live;
    try {
      live = new Live(kernel, world, { ...read(world, scene), end: 0 });
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      return { refused: [error.message] };
    }
    const rows = live.servos.map(() => []);
    const pulses = live.servos.map(() => []);
    const events = [];
    const begun = now();
    for (const { until, kind, value, servo } of steps) {
      try {
        while (live.due || !live.going.reached(until)) {
          const push = live.advance(until, rate, switches);
          push.parts.forEach(({ columns, points, pulses: heard }, k) => {
            for (let n = 0; n < points.length; n += columns.length) rows[k].push([...points.subarray(n, n + columns.length)]);
            for (let n = 0; n < heard.length; n += 2) pulses[k].push([heard[n], heard[n + 1]]);
          });
          events.push(...push.events);
        }
        if (kind) live.do(kind, value, servo ?? null);
      } catch (error) {
        if (!(error instanceof Refused)) throw error;
        refused.push(error.message);
        if (!kind || !live.going.reached(until)) break;
      }
    }
    return { rows, pulses, events, refused, text: written(world, live.now()), time: live.time,
      cpu: now() - begun };
  });
}
