// @ts-check
/** Talking to the server: actions by POST with the key of this run, news by an event stream. */

const key = location.hash.slice(1);
let tab = "";

/** An action that was refused, or could not be carried out. */
export class Refused extends Error {
  /** @param {string} message @param {number} status */
  constructor(message, status) {
    super(message);
    this.status = status;
  }
}

/**
 * Carry out an action.
 * @param {string} name
 * @param {object} [fields]
 * @returns {Promise<any>}
 */
export async function act(name, fields = {}) {
  /** @type {Response} */
  let response;
  try {
    response = await fetch(`/api/${name}`, {
      method: "POST",
      headers: { "Content-Type": "application/json", "X-Armkin-Key": key, "X-Armkin-Tab": tab },
      body: JSON.stringify(fields),
    });
  } catch {
    throw new Refused("armkin teach does not answer: is it still running in its terminal?", 0);
  }
  const answer = await response.json();
  if (!response.ok) throw new Refused(answer.error, response.status);
  return answer;
}

/**
 * Become a page of this run, and hear its news.
 * @param {Object<string, (data: any) => void>} hears topic -> what to do
 * @param {(lost: boolean) => void} lost
 * @returns {Promise<any>} the scene and what is shown
 */
export async function enter(hears, lost) {
  const opened = await act("open");
  tab = opened.tab;
  const events = new EventSource(`/events?tab=${tab}`);
  for (const [topic, hear] of Object.entries(hears)) {
    events.addEventListener(topic, (event) => hear(JSON.parse(event.data)));
  }
  events.onopen = () => lost(false);
  events.onerror = () => {
    lost(true);
    if (events.readyState === EventSource.CLOSED) setTimeout(() => location.reload(), 2000);
  };
  return opened;
}
