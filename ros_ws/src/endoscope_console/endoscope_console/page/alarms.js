/** Which alarms stand, most urgent first: those of the server, and what only the page can know. */

export const BLIND_S = 0.3;
export const SILENT_STATE_S = 3.5;
const ORDER = { high: 0, medium: 1, low: 2 };
export const SIGN = { high: 'Danger', medium: 'Warning', low: 'Note' };

/** Age in s from which the last state is out of date: it comes once a second. */
export const SILENT_CONSOLE_S = 2;
/** Age of the picture in s: of its newest sample when it was sent, and since it came. */
export const pictureAge = (picture, now) => (Number.isFinite(picture?.age) ? picture.age + (now - picture.arrived) : Infinity);

/**
 * @param server the alarms `{id, level, text, latched}` of the last state, or none
 * @param own `{connected, everConnected, pictureAge, gamepadLost, mine, lost}`: whether both sockets are open, and were;
 *   age of the picture in s; a gamepad that does not answer any more; `mine`: whether this page has the controls;
 *   `lost`: who took them from it just now
 */
export function standing(server, own) {
  // The release of a grip concerns its operator alone.
  const alarms = (server ?? []).filter(({ id }) => id !== 'dead_man' || own.mine);
  const here = [];
  const add = (id, level, text) => {
    if (!alarms.some((alarm) => alarm.id === id)) here.push({ id, level, text, latched: false });
  };
  if (own.everConnected && !own.connected) {
    // What was received before is out of date.
    alarms.length = 0;
    add('connection', 'medium', 'No connection to the console: nothing shown here is current. Reconnecting …');
  } else if (own.connected && own.pictureAge > BLIND_S && !alarms.some(({ id }) => id === 'graph')) {
    const age = Number.isFinite(own.pictureAge) ? ` is ${own.pictureAge.toFixed(1)} s old` : ' has not come yet';
    add('picture', 'medium', `The picture${age}. Motion is blocked until the view is current.`);
  }
  if (own.lost) add('lease', 'medium', own.lost);
  if (own.gamepadLost) add('gamepad', 'medium', 'The gamepad is gone.');
  // What only this page knows stands before what the server knows, of one level.
  return [...here, ...alarms].sort((a, b) => (ORDER[a.level] ?? 3) - (ORDER[b.level] ?? 3));
}
