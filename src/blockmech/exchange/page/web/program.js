// A generated program run without eval: its text is read once, and its operations are then interpreted.
//
// The text is that of `Script.compact`: one operation a line, whose value later lines name by the
// distance `~k` to it. Sines and others are those of `numbers.js`, so numbers are Python's.

import { atan2, cos, even, hypot, piece, rest, sin, spread } from "./numbers.js";

/** @type {((r: Float64Array, a: number, b: number, c: number) => number)[]} */
const ACTS = [
  (r, a, b) => r[a] + r[b], (r, a, b) => r[a] - r[b], (r, a, b) => r[a] * r[b], (r, a, b) => r[a] / r[b],
  (r, a, b) => Number(r[a] < r[b]), (r, a, b) => Number(r[a] <= r[b]), (r, a, b) => Number(r[a] > r[b]), (r, a, b) => Number(r[a] >= r[b]),
  (r, a, b) => Number(r[a] === r[b]), (r, a, b) => Number(r[a] !== r[b]), (r, a, b) => r[a] & r[b], (r, a, b) => r[a] | r[b],
  (r, a, b, c) => (r[a] ? r[b] : r[c]), (r, a) => -r[a], (r, a, b) => r[a + r[b]], (r, a) => r[a],
  (r, a, b, c) => piece(r.subarray(a, a + b), b, r[c]),
  (r, a) => Math.sqrt(r[a]), (r, a) => Math.abs(r[a]), (r, a) => Math.exp(r[a]), (r, a, b) => r[a] ** r[b],
  (r, a) => sin(r[a]), (r, a) => cos(r[a]), (r, a, b) => atan2(r[a], r[b]), (r, a, b) => hypot(r[a], r[b]),
  (r, a, b) => rest(r[a], r[b]), (r, a) => even(r[a]),
];
const INFIX = ["+", "-", "*", "/", "<", "<=", ">", ">=", "==", "!=", "&", "|"];
const [WHERE, NEGATE, ENTRY, COPY, PIECE] = [12, 13, 14, 15, 16];
const CALLS = ["Math.sqrt", "Math.abs", "Math.exp", "Math.pow", "sin", "cos", "atan2", "hypot", "rest", "even"];
const [SPREAD, UNLESS, JUMP] = [-1, -2, -3]; // that write no value

/** The operations of a text, and the numbers that they work on. */
export class Program {
  /** @param {string} text @param {number} parameters @param {number} inputs @param {number} outputs how many */
  constructor(text, parameters, inputs, outputs) {
    this.inputs = parameters; // where the inputs begin
    this.outputs = new Int32Array(outputs);
    this.size = parameters + inputs; // of the numbers, parameters and inputs first
    /** @type {number[]} */
    this.code = []; // five numbers an operation: act, target, arguments
    /** @type {Map<string, number>} */
    this.names = new Map(); // constants, tables and states
    /** @type {number[]} */
    this.values = []; // where the value of each line is
    /** @type {[number, number][]} */
    this.constants = [];
    /** @type {[number, number][]} */
    const loops = []; // the test of a loop, and its index
    this.status = -1;
    for (const line of text.split("\n")) this.read(line, loops);
    this.numbers = new Float64Array(this.size);
    for (const [at, x] of this.constants) this.numbers[at] = x;
    this.steps = Int32Array.from(this.code);
  }

  /** @param {string} line @param {[number, number][]} loops */
  read(line, loops) {
    const named = line.match(/^(?:const |let )?(s\d+_\d+_?|\w+_\d+) = (.*);$/);
    const loop = line.match(/^for \(let (n\d+) = 0; n\d+ < (\d+) && (.*); \+\+n\d+\) \{$/);
    const end = line.match(/^(?:out\[(\d+)\] = (.*)|return Number\((.*)\)|spread\((.*), (\d+)\));$/);
    if (named) {
      const [, name, text] = named;
      if (text[0] === "[") this.names.set(name, this.row(text));
      else {
        if (!this.names.has(name)) this.names.set(name, this.size++);
        this.put(COPY, /** @type {number} */ (this.names.get(name)), this.at(text));
      }
    } else if (loop) {
      const [index, cap] = [this.size++, this.at(loop[2])];
      this.put(COPY, index, this.at("0"));
      const under = this.size++;
      loops.push([this.code.length, index]);
      this.put(INFIX.indexOf("<"), under, index, cap);
      this.put(INFIX.indexOf("&"), under, under, this.at(loop[3]));
      this.put(UNLESS, 0, under);
    } else if (line === "}") {
      const [test, index] = /** @type {[number, number]} */ (loops.pop());
      this.put(INFIX.indexOf("+"), index, index, this.at("1"));
      this.put(JUMP, test);
      this.code[test + 11] = this.code.length;
    } else if (!end) this.values.push(line[0] === "[" ? this.row(line) : this.expression(line));
    else if (end[1]) this.outputs[Number(end[1])] = this.at(end[2]);
    else if (end[3]) this.status = this.at(end[3]);
    else this.put(SPREAD, 0, this.at(end[4]), Number(end[5]));
  }

  /** Numbers side by side. @param {string} text @returns {number} where the first is */
  row(text) {
    const entries = text.slice(1, -1).split(", ").map((word) => this.at(word));
    const first = this.size;
    this.size += entries.length;
    entries.forEach((from, k) => this.put(COPY, first + k, from));
    return first;
  }

  /** @param {number} act @param {number} target @param {number[]} from */
  put(act, target, ...from) {
    this.code.push(act, target, from[0] ?? 0, from[1] ?? 0, from[2] ?? 0);
    return target;
  }

  /** Where the first number of a table is. @param {string} text */
  table(text) {
    const slice = text.match(/^p\.slice\((\d+), \d+\)$/);
    return slice ? Number(slice[1]) : /** @type {number} */ (this.names.get(text));
  }

  /** @param {string} text */
  expression(text) {
    const target = this.size++;
    const words = text.split(" ");
    if (words[1] === "?") return this.put(WHERE, target, this.at(words[0]), this.at(words[2]), this.at(words[4]));
    if (INFIX.includes(words[1])) return this.put(INFIX.indexOf(words[1]), target, this.at(words[0]), this.at(words[2]));
    const entry = text.match(/^(p\.slice\(.*\)|\w+)\[(~\d+)\]$/);
    const called = text.match(/^([\w.]+|-)\((.*)\)$/);
    if (entry) return this.put(ENTRY, target, this.table(entry[1]), this.at(entry[2]));
    if (!called) return this.put(COPY, target, this.at(text));
    const [, name, inside] = called;
    if (name === "piece") {
      const [, table, count, x] = /** @type {RegExpMatchArray} */ (inside.match(/^(.*), (\d+), (.*)$/));
      return this.put(PIECE, target, this.table(table), Number(count), this.at(x));
    }
    const act = name === "-" ? NEGATE : PIECE + 1 + CALLS.indexOf(name);
    return this.put(act, target, ...inside.split(", ").map((word) => this.at(word)));
  }

  /** Where a number is. @param {string} word @returns {number} */
  at(word) {
    const known = this.names.get(word);
    if (known !== undefined) return known;
    const indexed = word.match(/^(.*)\[(\d+)\]$/);
    if (indexed) {
      const k = Number(indexed[2]);
      return indexed[1] === "p" ? k : indexed[1] === "u" ? this.inputs + k : this.at(indexed[1]) + k;
    }
    if (word[0] === "~") return this.values[this.values.length - Number(word.slice(1))];
    const x = Number(word);
    if (Number.isNaN(x) && word !== "NaN") throw new Error(`no program has "${word}"`);
    this.names.set(word, this.size);
    this.constants.push([this.size, x]);
    return this.size++;
  }

  /** The outputs for parameters and inputs; 0, or the number of the reason why there is no answer. @param {ArrayLike<number>} p @param {ArrayLike<number>} u @param {Float64Array} out @returns {number} */
  run(p, u, out) {
    const [r, code] = [this.numbers, this.steps];
    r.set(p, 0);
    r.set(u, this.inputs);
    for (let k = 0; k < code.length; k += 5) {
      const [act, to, a, b] = [code[k], code[k + 1], code[k + 2], code[k + 3]];
      if (act >= 0) r[to] = ACTS[act](r, a, b, code[k + 4]);
      else if (act === SPREAD) spread(r.subarray(a, a + b * b), b);
      else if (act === JUMP) k = to - 5;
      else if (!r[a]) k = to - 5;
    }
    this.outputs.forEach((at, i) => (out[i] = r[at]));
    return r[this.status];
  }
}
