/** Opens, saves and exports files, and recovers projects after a crash or a reload. */

import * as autosave from "../document/autosave";
import * as commands from "../document/commands";
import { type Document, gapOf } from "../document/document";
import { fromProject, toProject } from "../document/project";
import { wholeMotion } from "../engine/motion";
import type { Project } from "../protocol";
import { checkProject, exportFile, opened, openRig, sample } from "../server/api";
import type { Studio } from "../studio.svelte";

/** Largest file in bytes (see protocol.py). */
const LARGEST_UPLOAD = 64 * 1024 * 1024;

export async function openFile(studio: Studio, file: File): Promise<boolean> {
  try {
    if (/\.(interpose|json)$/i.test(file.name)) {
      const project = await checkProject(file).catch((error: Error) => {
        throw new Error(`${file.name}: ${error.message}`);
      });
      await openProject(studio, project);
    }
    else if (/\.bvh$/i.test(file.name)) {
      if (file.size > LARGEST_UPLOAD) throw new Error(`${file.name} is larger than ${LARGEST_UPLOAD / 2 ** 20} MB; open a shorter clip`);
      await openClip(studio, file.name, await file.text());
    } else throw new Error(`${file.name}: only .bvh clips and .interpose projects can be opened`);
    return true;
  } catch (error) {
    studio.notices.warn(error);
    return false;
  }
}

async function openClip(studio: Studio, name: string, text: string): Promise<void> {
  const rig = await openRig(name, text);
  studio.open(commands.fromClip({ name, text }, rig), rig);
  if (rig.reason) studio.notices.show(`${name}: ${rig.reason}. Its gaps are interpolated.`, "warning");
}

async function openProject(studio: Studio, project: Project): Promise<void> {
  const rig = await openRig(project.source.name, project.source.text);
  const { document, shown } = fromProject(project, rig);
  studio.open(document, rig, shown);
}

export async function openSample(studio: Studio): Promise<void> {
  await openProject(studio, await sample());
  untouched = studio.document;
}

/** The sample as it was opened, which need not be stored. */
let untouched: Document | null = null;

/** The current project. */
function projectOf(studio: Studio): Project | null {
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

/** Exports the whole motion, once every gap is generated. */
export async function exportMotion(studio: Studio, format: "bvh" | "glb"): Promise<boolean> {
  try {
    await until(() => studio.settled);
    const { document, rig } = studio;
    if (!document || !rig) return false;
    const failed = studio.gaps().find((gap) => studio.state(gap) === "failed");
    if (failed) throw new Error(`the gap at ${failed.left.frame} could not be generated: ${studio.failure(failed.id)}`);
    const { rows, own } = wholeMotion(document, studio.shown);
    const arrays = { frames: { shape: [rows.length / rig.stride, rig.stride], values: rows } };
    const what = { rig: rig.id, format, rows: own };
    download(await studio.withRig(() => exportFile(what, arrays)), `${document.name}.${format}`);
    return true;
  } catch (error) {
    studio.notices.show(`Nothing was exported: ${error instanceof Error ? error.message : error}`, "error");
    return false;
  }
}

/** Opens this tab's last project, the file from the command line, or the sample, and offers to recover what other tabs
 * have left unsaved. */
export async function start(studio: Studio, tab: string): Promise<"recovered" | "opened" | "sample"> {
  const saved = await autosave.load(tab).catch(() => null);
  if (saved) {
    try {
      await openProject(studio, await checkProject(saved.project));
      if (saved.changed) studio.written = null;
      studio.notices.show(`Restored “${saved.project.name}”.`);
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
    studio.notices.show(`“${left.project.name}” has unsaved changes from ${ago(left.saved)}.`, "info", {
      label: "Recover",
      run: () => void recover(studio, left),
    });
  }
  return named.project || named.source ? "opened" : "sample";
}

/** Stores the project of this tab in the browser. */
export async function keep(studio: Studio, tab: string): Promise<void> {
  const { document } = studio;
  const project = projectOf(studio);
  if (project && document !== untouched) await autosave.save(tab, project, studio.changed);
}

async function recover(studio: Studio, { tab, project }: autosave.Saved): Promise<void> {
  try {
    await openProject(studio, await checkProject(project));
    studio.written = null;
    await autosave.forget(tab);
  } catch (error) {
    studio.notices.warn(error);
  }
}

function ago(time: number): string {
  const minutes = Math.round((Date.now() - time) / 60_000);
  if (minutes < 1) return "a moment ago";
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
