/** A name for this tab that survives a reload. A duplicated tab, which starts with the same name, gets a new one. */

const ITEM = "interpose-tab";

export async function tabName(): Promise<string> {
  const had = sessionStorage.getItem(ITEM);
  if (had && (await hold(had))) return had;
  const name = crypto.randomUUID();
  sessionStorage.setItem(ITEM, name);
  await hold(name);
  return name;
}

/** Locks the name for the lifetime of the page; false if another tab holds it. */
function hold(name: string): Promise<boolean> {
  if (!("locks" in navigator)) return Promise.resolve(true);
  return new Promise((answer) => {
    void navigator.locks.request(`interpose-tab-${name}`, { ifAvailable: true }, (lock) => {
      answer(lock !== null);
      return lock === null ? undefined : new Promise(() => undefined);
    });
  });
}
