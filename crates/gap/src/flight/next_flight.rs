//! The flight that would tell rivals apart, as a card for the pilot.

use super::answer::Answer;
use crate::verdict::NextFlight;

/// What tells which kinds of effect apart, in the words of a flight card.
const MANOEUVRES: [(&[&str], &str); 6] = [
    (
        &["actuator-delay", "actuator-lag"],
        "3-2-1-1 steps and a frequency sweep of elevator and ailerons up to 5 Hz, logged at 100 Hz: a \
         delay turns the phase in proportion to frequency, a lag also lowers the amplitude",
    ),
    (
        &["drag-increase", "thrust-loss"],
        "a glide with the motor off and level runs at three throttles: drag shows alone in the \
         glide",
    ),
    (
        &["mass-change", "lift-slope", "alpha-vane-scale"],
        "level runs at the slowest, cruise and fastest speed, pull-ups and push-overs at each: the \
         angle of attack goes with mass at all speeds, with the slope by its change alone",
    ),
    (
        &["surface-trim-offset", "cg-shift"],
        "level runs at the slowest, cruise and fastest speed, and elevator doublets at each: the \
         elevator that an offset needs is the same at all speeds, that of a shifted centre of \
         gravity is not",
    ),
    (
        &["control-effectiveness", "roll-damping", "pitch-damping"],
        "doublets of each surface, short (0.3 s) and long (2 s): the first acceleration is the \
         surface's, the steady rate is surface over damping",
    ),
    (
        &["airspeed-scale", "wind-bias"],
        "full circles at constant airspeed: wind changes the speed over ground with the heading, a \
         scale does not",
    ),
];

/// The card for the first cause that is a set.
pub fn propose(answer: &Answer) -> Option<NextFlight> {
    let cause = answer.causes.iter().find(|c| c.mechanisms.len() > 1)?;
    let rivals = &cause.mechanisms;
    let hits = |ids: &[&str]| rivals.iter().filter(|m| ids.contains(&m.as_str())).count();
    let best = MANOEUVRES.iter().max_by_key(|(ids, _)| hits(ids))?;
    Some(NextFlight::in_words(rivals, best.1))
}
