/** HTTP requests for rigs, projects and exports. A refusal throws an error with the server's reason. */

import type { Export, Opened, Project, Refusal, Rig as RigMessage } from "../protocol";
import type { Rig } from "../rig";
import { rigOf } from "../rig";
import type { Arrays } from "./messages";
import { pack, unpack } from "./messages";
import { Unanswered } from "./connection";

export async function openRig(name: string, bytes: Blob | string): Promise<Rig> {
  const answer = await post(`/api/rigs?name=${encodeURIComponent(name)}`, bytes);
  const { header, arrays } = unpack<RigMessage>(await answer.arrayBuffer());
  return rigOf(header, arrays);
}

export async function opened(): Promise<Opened> {
  return (await request(fetch("/api/opened"))).json() as Promise<Opened>;
}

export async function sample(): Promise<Project> {
  return (await request(fetch("/api/sample"))).json() as Promise<Project>;
}

export async function checkProject(project: Project | Blob): Promise<Project> {
  const text = project instanceof Blob ? project : JSON.stringify(project);
  return (await post("/api/projects", text, "application/json")).json() as Promise<Project>;
}

export async function exportFile(what: Omit<Export, "arrays">, arrays: Arrays): Promise<Blob> {
  return (await post("/api/export", pack(what, arrays))).blob();
}

function post(url: string, body: BodyInit, type = "application/octet-stream"): Promise<Response> {
  return request(fetch(url, { method: "POST", body, headers: { "Content-Type": type } }));
}

async function request(request: Promise<Response>): Promise<Response> {
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
