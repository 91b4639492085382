/** Stores the current project in the browser (IndexedDB), so that a crash or a reload loses nothing. */

import type { Project } from "../protocol";

const NAME = "interpose-studio";
const STORE = "projects";
/** How long, and how many, projects of closed tabs are kept. */
const DAYS = 30;
const MOST = 8;

export interface Saved {
  /** The name of the tab. */
  readonly tab: string;
  readonly saved: number;
  readonly project: Project;
  /** Whether it has changes that are not saved to a file. */
  readonly changed: boolean;
}

export async function save(tab: string, project: Project, changed: boolean): Promise<void> {
  const store = await open("readwrite");
  await done(store.put({ tab, saved: Date.now(), project, changed } satisfies Saved));
}

export async function load(tab: string): Promise<Saved | null> {
  const store = await open("readonly");
  return ((await done(store.get(tab))) as Saved | undefined) ?? null;
}

/** The projects of other tabs, newest first; old ones are deleted. */
export async function others(tab: string): Promise<Saved[]> {
  const store = await open("readwrite");
  const all = (await done(store.getAll())) as Saved[];
  const newest = all.filter((each) => each.tab !== tab).sort((a, b) => b.saved - a.saved);
  const kept = newest.filter((each, i) => i < MOST && Date.now() - each.saved < DAYS * 86_400_000);
  for (const each of newest) if (!kept.includes(each)) store.delete(each.tab);
  return kept;
}

export async function forget(tab: string): Promise<void> {
  await done((await open("readwrite")).delete(tab));
}

function open(mode: IDBTransactionMode): Promise<IDBObjectStore> {
  return new Promise((resolve, reject) => {
    const request = indexedDB.open(NAME, 1);
    request.onupgradeneeded = () => request.result.createObjectStore(STORE, { keyPath: "tab" });
    request.onerror = () => reject(request.error);
    request.onsuccess = () => {
      const transaction = request.result.transaction(STORE, mode);
      transaction.oncomplete = () => request.result.close();
      transaction.onabort = () => request.result.close();
      resolve(transaction.objectStore(STORE));
    };
  });
}

function done<T>(request: IDBRequest<T>): Promise<T> {
  return new Promise((resolve, reject) => {
    request.onsuccess = () => resolve(request.result);
    request.onerror = () => reject(request.error);
  });
}
