//! Topics of the bus of a mission.

use protocol::Topic;

const PATHS: [&str; 16] = [
    "va/1/state",
    "va/1/reading",
    "va/1/mode",
    "va/1/event",
    "va/1/setpoint",
    "va/1/control",
    "va/1/mavlink/rx",
    "ws/main/ambient/1",
    "ws/main/model",
    "ws/main/event",
    "sc/main/population",
    "sc/main/observation",
    "sc/main/plan",
    "sc/main/extension",
    "clock/main/tick",
    "clock/main/done/va/1",
];

/// One of them.
pub fn topic(number: u8) -> Topic {
    let path = PATHS[usize::from(number) % PATHS.len()];
    match Topic::parse_path(path) {
        Ok(topic) => topic,
        Err(refused) => panic!("{refused}"),
    }
}
