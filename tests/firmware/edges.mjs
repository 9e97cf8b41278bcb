// Run the firmware in avr8js by a script and write down what its pins do, as edges.c does in simavr:
// node edges.mjs FIRMWARE.hex SCRIPT LOG SECONDS, with the folder of node_modules in AVR8JS.
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";

const js = createRequire(`${process.env.AVR8JS}/`)("avr8js");
const CYCLES = 16e6, CYCLES_PER_BYTE = 320;
const [firmware, scriptPath, logPath, seconds] = process.argv.slice(2);

function flash(text) {
  const bytes = new Uint8Array(32768);
  for (const line of text.trim().split(/\s+/)) {
    const record = Buffer.from(line.slice(1), "hex");
    if (record[3] === 0) bytes.set(record.subarray(4, 4 + record[0]), record.readUInt16BE(1));
  }
  return new Uint16Array(bytes.buffer);
}

const script = readFileSync(scriptPath, "utf8");
const lines = script.slice(1).trim().split("\n").filter(Boolean).map((line) => line.split(" "));
const log = [];
const cpu = new js.CPU(flash(readFileSync(firmware, "utf8")), 2048);
const timer1 = new js.AVRTimer(cpu, js.timer1Config);
const portB = new js.AVRIOPort(cpu, js.portBConfig), portD = new js.AVRIOPort(cpu, js.portDConfig);
const usart = new js.AVRUSART(cpu, js.usart0Config, CYCLES);
const adc = new js.AVRADC(cpu, js.adcConfig);
adc.aref = 2.5;
portB.setPin(0, script[0] !== "j");

let pulse = false, light = false, enable = false, said = [], worst = 0;
portB.addListener(() => {
  const level = portB.pinState(1) === js.PinState.High, lit = portB.pinState(5) === js.PinState.High;
  if (level !== pulse) {
    // An instruction is one piece to the simulator: the cycle of the timer's step, not of the instruction's end
    worst = Math.max(worst, cpu.cycles - timer1.lastCycle);
    log.push(`P ${timer1.lastCycle} ${Number(level)}`);
  }
  if (lit !== light) log.push(`L ${cpu.cycles} ${Number(lit)}`);
  [pulse, light] = [level, lit];
});
portD.addListener((value) => {
  if (enable && !(value & 8)) log.push(`D ${cpu.cycles} ${(value >> 2) & 1} ${(value >> 4).toString(16)}`);
  enable = Boolean(value & 8);
});
usart.onByteTransmit = (byte) => {
  if (byte) said.push(byte);
  else {
    if (said.length) log.push(`U ${cpu.cycles} ${Buffer.from(said).toString("hex")}`);
    said = [];
  }
};

// What is due of the script; returns when to come back.
let waiting = [];
function feed() {
  if (waiting.length) {
    // avr8js holds one received byte and not three as the chip does: wait until it is read
    if (usart.rxBusy || cpu.data[js.usart0Config.UCSRA] & 0x80) return cpu.cycles + 16;
    usart.writeByte(waiting.shift());
    return cpu.cycles + CYCLES_PER_BYTE;
  }
  if (!lines.length) return Infinity;
  const [word, at, first, second] = lines[0];
  if (Number(at) > cpu.cycles) return Number(at);
  lines.shift();
  if (word === "adc") adc.channelValues[Number(first)] = Number(second) / 1000;
  else waiting = [...Buffer.from(first, "hex")];
  return cpu.cycles;
}

let next = 0;
for (const end = CYCLES * Number(seconds); cpu.cycles < end;) {
  js.avrInstruction(cpu);
  cpu.tick();
  if (cpu.cycles >= next) next = feed();
}
writeFileSync(logPath, log.join("\n") + "\n");
console.log(`the pin at most ${worst} cycles behind the timer`);
