/** A name for this tab that survives its reload. A duplicated tab, which begins with the same name, gets another one. */

const ITEM = "interpose-tab";

export async function tabName(): Promise<string> {
  const had = sessionStorage.getItem(ITEM);
  if (had && (await hold(had))) return had;
  const name = crypto.randomUUID();
  sessionStorage.setItem(ITEM, name);
  await hold(name);
  return name;
}

/** Holds the name as long as the page lives; false where another tab holds it. */
function hold(name: string): Promise<boolean> {
  if (!("locks" in navigator)) return Promise.resolve(true);
  return new Promise((answer) => {
    void navigator.locks.request(`interpose-tab-${name}`, { ifAvailable: true }, (lock) => {
      answer(lock !== null);
      return lock === null ? undefined : new Promise(() => undefined);
    });
  });
}
