/** Files in and out: opening by button, drop or command line, saving, exporting, and recovery after a crash or reload. */

import * as autosave from "./document/autosave";
import * as commands from "./document/commands";
import { type Document, gapOf } from "./document/document";
import { fromProject, toProject } from "./document/project";
import { wholeMotion } from "./engine/motion";
import type { Project } from "./protocol";
import { checkProject, exportFile, opened, openRig, sample } from "./server/api";
import { Unanswered } from "./server/connection";
import type { Studio } from "./studio.svelte";

/** Bytes of a file at most (protocol.py, LARGEST_UPLOAD). */
const LARGEST = 64 * 1024 * 1024;

export async function openFile(studio: Studio, file: File): Promise<boolean> {
  try {
    if (/\.(interpose|json)$/i.test(file.name)) {
      const project = await checkProject(file).catch((error: Error) => {
        throw new Error(`${file.name}: ${error.message}`);
      });
      await openProject(studio, project);
    }
    else if (/\.bvh$/i.test(file.name)) {
      if (file.size > LARGEST) throw new Error(`${file.name} has more than ${LARGEST / 2 ** 20} MB; open a shorter clip`);
      await openClip(studio, file.name, await file.text());
    } else throw new Error(`${file.name}: only .bvh clips and .interpose projects can be opened`);
    return true;
  } catch (error) {
    studio.notices.warn(error);
    return false;
  }
}

export async function openClip(studio: Studio, name: string, text: string): Promise<void> {
  const rig = await openRig(name, text);
  studio.open(commands.fromClip({ name, text }, rig), rig);
  if (rig.reason) studio.notices.say(`${name}: ${rig.reason}. Gaps are interpolated.`, "warning");
}

export async function openProject(studio: Studio, project: Project): Promise<void> {
  const rig = await openRig(project.source.name, project.source.text);
  const { document, shown } = fromProject(project, rig);
  studio.open(document, rig, shown);
}

export async function openSample(studio: Studio): Promise<void> {
  await openProject(studio, await sample());
  untouched = studio.document;
}

/** The sample as it was opened: there is no need to keep it. */
let untouched: Document | null = null;

/** The project as it is. */
export function projectOf(studio: Studio): Project | null {
  const { document } = studio;
  return document && toProject(document, (key) => {
    const gap = gapOf(document, key.id);
    return gap && studio.state(gap) === "ready" ? studio.rows(gap) : null;
  });
}

export function saveProject(studio: Studio): void {
  const project = projectOf(studio);
  if (!project) return;
  download(new Blob([JSON.stringify(project)], { type: "application/json" }), `${project.name}.interpose`);
  studio.written = studio.document;
}

/** Writes the whole motion; waits until every gap shows what was asked for. */
export async function exportMotion(studio: Studio, format: "bvh" | "glb"): Promise<boolean> {
  try {
    await until(() => studio.settled);
    const { document, rig } = studio;
    if (!document || !rig) return false;
    const failed = studio.gaps().find((gap) => studio.state(gap) === "failed");
    if (failed) throw new Error(`the gap at ${failed.left.frame} could not be made: ${studio.failure(failed.id)}`);
    const { rows, own } = wholeMotion(document, (gap) => studio.rows(gap));
    const arrays = { frames: { shape: [rows.length / rig.stride, rig.stride], values: rows } };
    const what = { rig: rig.id, format, rows: own };
    let blob: Blob;
    try {
      blob = await exportFile(what, arrays);
    } catch (error) {
      if (!(error instanceof Unanswered && error.again)) throw error;
      await openRig(document.source.name, document.source.text);
      blob = await exportFile(what, arrays);
    }
    download(blob, `${document.name}.${format}`);
    return true;
  } catch (error) {
    studio.notices.say(`Nothing was exported: ${error instanceof Error ? error.message : error}`, "error");
    return false;
  }
}

/** What is shown first: what this tab had, else what the command line named, else the sample; and an offer of what other
 * tabs have left behind. */
export async function start(studio: Studio, tab: string): Promise<"recovered" | "opened" | "sample"> {
  const saved = await autosave.load(tab).catch(() => null);
  if (saved) {
    try {
      await openProject(studio, saved.project);
      if (saved.changed) studio.written = null;
      studio.notices.say(`“${saved.project.name}” is as you left it.`);
      return "recovered";
    } catch (error) {
      studio.notices.warn(error);
    }
  }
  const named = await opened();
  if (named.project) await openProject(studio, named.project);
  else if (named.source) await openClip(studio, named.source.name, named.source.text);
  else await openSample(studio);
  const left = (await autosave.others(tab).catch(() => [])).find(({ changed }) => changed);
  if (left) {
    studio.notices.say(`“${left.project.name}” was left unsaved ${ago(left.saved)}.`, "info", {
      label: "Recover",
      run: () => void recover(studio, left),
    });
  }
  return named.project || named.source ? "opened" : "sample";
}

/** Keeps the project of this tab in the browser. */
export async function keep(studio: Studio, tab: string): Promise<void> {
  const { document } = studio;
  const project = projectOf(studio);
  if (project && document !== untouched) await autosave.save(tab, project, studio.changed);
}

async function recover(studio: Studio, { tab, project }: autosave.Saved): Promise<void> {
  try {
    await openProject(studio, project);
    studio.written = null;
    await autosave.forget(tab);
  } catch (error) {
    studio.notices.warn(error);
  }
}

function ago(time: number): string {
  const minutes = Math.round((Date.now() - time) / 60_000);
  if (minutes < 1) return "just now";
  if (minutes < 60) return `${minutes} min ago`;
  const hours = Math.round(minutes / 60);
  return hours < 24 ? `${hours} h ago` : `${Math.round(hours / 24)} days ago`;
}

function until(met: () => boolean): Promise<void> {
  return new Promise((resolve) => {
    const look = () => (met() ? resolve() : setTimeout(look, 50));
    look();
  });
}

function download(blob: Blob, name: string): void {
  const link = window.document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}
