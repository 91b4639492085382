/** What the browser asks over HTTP: rigs, projects, exports. What is refused throws the server's sentence. */

import type { Export, Opened, Project, Refusal, Rig as ToldRig } from "../protocol";
import type { Rig } from "../rig";
import { rigOf } from "../rig";
import type { Arrays } from "../wire";
import { pack, unpack } from "../wire";
import { Unanswered } from "./connection";

export async function openRig(name: string, bytes: Blob | string): Promise<Rig> {
  const answer = await post(`/api/rigs?name=${encodeURIComponent(name)}`, bytes);
  const { header, arrays } = unpack<ToldRig>(await answer.arrayBuffer());
  return rigOf(header, arrays);
}

export async function opened(): Promise<Opened> {
  return (await asked(fetch("/api/opened"))).json() as Promise<Opened>;
}

export async function sample(): Promise<Project> {
  return (await asked(fetch("/api/sample"))).json() as Promise<Project>;
}

export async function checkProject(text: string | Blob): Promise<Project> {
  return (await post("/api/projects", text, "application/json")).json() as Promise<Project>;
}

export async function exportFile(what: Omit<Export, "arrays">, arrays: Arrays): Promise<Blob> {
  return (await post("/api/export", pack(what, arrays))).blob();
}

function post(url: string, body: BodyInit, type = "application/octet-stream"): Promise<Response> {
  return asked(fetch(url, { method: "POST", body, headers: { "Content-Type": type } }));
}

async function asked(request: Promise<Response>): Promise<Response> {
  let answer: Response;
  try {
    answer = await request;
  } catch {
    throw new Unanswered("the studio's server does not answer; start it again with 'interpose studio'");
  }
  if (answer.ok) return answer;
  const refusal = (await answer.json().catch(() => null)) as Refusal | null;
  throw new Unanswered(refusal?.reason ?? `the server answered ${answer.status}`, refusal?.again ?? false);
}
