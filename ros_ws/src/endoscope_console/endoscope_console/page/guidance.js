/** Instructions for the next step, from the server's state and the hands. */

import { SILENT_STATE_S } from './alarms.js';

/** Reasons of the dead-man in words; what is not listed is shown as received. */
const REASONS = {
  released: 'let go', silent: 'no sign of the hand for 0.1 s', late: 'frames came late', order: 'frames out of order',
  malformed: 'a malformed frame', flood: 'too many frames', hidden: 'this page was hidden',
  unfocused: 'this page is not in front',
  closed: 'page closed', lost: 'controls lost', unplugged: 'gamepad unplugged', state: 'not enabled',
  calibration: 'calibration', source: 'master follows something else', blind: 'picture too old',
  stalled: 'the server was not run in time', 'hands on': 'let go first',
};
const PLAYED = { file: 'the experiment', motion: 'the motion' };
const ENDED_BY_HAND = new Set(['', 'released', 'let go']);

export const inWords = (reason) => REASONS[reason] ?? (reason || '');

/** Name of a client as people know it; empty for nobody. */
export function nameOf(client, state) {
  return state?.lease?.operators?.find(({ name }) => name === client)?.label ?? client ?? '';
}

/** What the master plays, in words; empty while it follows a hand. */
export const played = (state) => PLAYED[state?.console?.source] ?? '';

/** Whether the last grip was ended by something else than the hand. */
export const endedForHim = (reason) => !ENDED_BY_HAND.has(reason);

/** FOLLOWING, HELD or OPEN, as the lamp has it. */
export function lamp(state) {
  const deadMan = state?.dead_man;
  if (deadMan?.state === 'ENGAGED' && deadMan.following) return 'FOLLOWING';
  if (deadMan?.state === 'ENGAGED') return 'HELD';
  return 'OPEN';
}

/** Whether the last calibration found the tube outside all known classes. */
export const isOfNoClass = (state) => Boolean(state?.calibration?.result?.none);

/** Whether a calibration has found the class of the tube. */
export const isCalibrated = (state) => Number.isFinite(state?.calibration?.result?.class_deg);

/** Whether the last state of the supervisor is up to date. */
export const stateIsFresh = (state, stateAge) =>
  Boolean(state?.operating_state) && !state.graph_ended && stateAge <= SILENT_STATE_S;

/**
 * The step that comes next, 0 to 5, and what to say:
 * 0 cannot, 1 take the controls, 2 enable, 3 calibrate (or move uncompensated), 4 let go first, 5 hold and move.
 */
export function nextStep({ connected, current, role, mine, state, stateAge, rests, busy, half, held, touch, home, why }) {
  if (!connected) return { step: 0, text: `Connecting to the console …${why ? ` Its reason: ${why}.` : ''}` };
  if (!state) return { step: 0, text: 'Waiting for the graph …' };
  if (!current) return { step: 0, text: 'No message from the console. Let go: what is shown is not current.' };
  if (state.graph_ended) return { step: 0, text: 'Nothing moves: the graph has ended. Restart endoscope console in its terminal.' };
  if (role !== 'operator') return { step: 0, text: 'You are looking on. To operate, open the operator’s address.' };
  const { lease, calibration, playing, dead_man: deadMan } = state;
  if (!mine && lease?.holder) return { step: 1, text: `${nameOf(lease.holder, state)} has the controls. Watch, or take over.` };
  if (!mine && state.operating_state === 'ENABLED') {
    return { step: 1, text: 'Enabled, and nobody operates: take the controls, or press PAUSE or Disable.' };
  }
  if (!mine) return { step: 1, text: 'Take the controls. Nothing moves yet.' };
  if (!stateIsFresh(state, stateAge)) return { step: 0, text: 'The supervisor is silent. Nothing moves until it is back.' };
  if (calibration?.running) return { step: 0, text: 'Calibrating: the instrument moves by itself. Esc pauses it.' };
  if (state.operating_state === 'FAULT') {
    const causes = state.causes ?? [];
    if (causes.length) return { step: 0, text: 'Held. Clear the cause of the fault, then enable.' };
    if (rests) return { step: 0, text: 'Held. The cause of the fault is gone; Enable can be held in a moment.' };
    return { step: 2, text: 'The cause of the fault is gone. Hold Enable for 1 s.' };
  }
  if (state.prepares) return { step: 0, text: 'The motion is being prepared. It can be enabled in a moment.' };
  const orKey = touch ? '.' : ', or key E.';
  const hold = touch ? 'Hold the left area and the pad' : 'Hold Space';
  if (state.operating_state === 'PAUSED') return { step: 2, text: `Paused, position held. Hold Resume for 1 s${orKey}` };
  if (state.operating_state !== 'ENABLED') return { step: 2, text: `Hold Enable for 1 s${orKey} The motors then hold.` };
  if (state.investigates && !playing) return { step: 0, text: 'Let go: the recording begins or ends.' };
  if (deadMan?.state === 'ENGAGED') {
    const verb = playing ? `Playing ${played(state)}, ${Math.round(100 * (playing.progress ?? 0))} % done` : 'Following';
    return { step: 5, text: `${verb}. Let go, and it stops.` };
  }
  if (half) return { step: 5, text: 'One finger is down. Hold the left area and the pad together.' };
  if (deadMan?.state === 'READY') {
    if (playing) return { step: 5, text: `${hold}, and ${played(state)} plays. Let go, and it stops.` };
    const move = touch ? 'hold the left area and drag' : 'hold Space and an arrow key';
    if (isOfNoClass(state)) {
      return { step: 5, text: `None of the classes fits this tube: record a motion, and Explain or Investigate (tab Explain) says what differs. Or ${move}, uncompensated.` };
    }
    if (!isCalibrated(state)) {
      return { step: 3, text: `Hold Calibrate for 1 s${touch ? '' : ', or key C'}: it moves by itself for some seconds. Or ${move}, uncompensated.` };
    }
    const homing = home ? ` Or hold Home for 1 s${touch ? '' : ', or key H'}: the motors turn to zero.` : '';
    return { step: 5, text: `${touch ? 'Hold the left area, and drag on the pad.' : 'Hold Space and press an arrow key, or drag on the pad.'}${homing}` };
  }
  const missing = deadMan?.missing || deadMan?.reason || '';
  if (held || busy || missing === 'hands on') return { step: 4, text: 'Let go of everything first, then hold again.' };
  return { step: 4, text: endedForHim(missing) ? `Not ready: ${inWords(missing)}.` : 'Getting ready …' };
}
