// Asks the server. Addresses are relative to the page's own, which in a notebook holds the key.

/** @typedef {import("./state.js").Sheet} Sheet */

export class Refused extends Error {
  /** @param {number} status @param {{said: string, problems: {where: string, found: string, remedy?: string, valid?: string, code: string}[]}} body */
  constructor(status, body) {
    super(body.said);
    this.status = status;
    this.problems = body.problems ?? [];
  }

  /** What is wrong, for the hand that did it. */
  get words() {
    const said = this.problems.map((p) => [p.found, p.valid, p.remedy].filter(Boolean).join(". "));
    return said.length ? `${this.problems[0].where}: ${said.join("; ")}` : this.message;
  }
}

/**
 * An answer of the API. Throws `Refused` with the reason.
 * @param {string} path @param {object} [body] @returns {Promise<any>}
 */
export async function ask(path, body) {
  const how = body && { method: "POST", body: JSON.stringify(body), headers: { "Content-Type": "application/json" } };
  const reply = await fetch(new URL(`api/${path}`, document.baseURI), how);
  const made = await reply.json().catch(() => ({ said: `the server says ${reply.status}`, problems: [] }));
  if (!reply.ok) throw new Refused(reply.status, made);
  return made;
}

/**
 * Follow what a stream says, until it is closed.
 * @param {string} path @param {(data: any) => void} heard
 */
export function stream(path, heard) {
  const source = new EventSource(new URL(`api/${path}`, document.baseURI));
  source.addEventListener("message", (event) => heard(JSON.parse(event.data)));
  return source;
}

/** A module by the hash of its text. @param {string} hash @returns {Promise<import("./lib/live.js").Kernel>} */
export const kernel = (hash) => import(new URL(`kernels/${hash}.js`, document.baseURI).href);

/** Let the browser save a file. @param {Blob} content @param {string} name */
export function save(content, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(content), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60e3);
}
