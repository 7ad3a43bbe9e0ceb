//! What differs between the autopilots that the bridge can command, as data: numbers and names of modes, what their
//! commands mean, which parameters tell how they fail safe, and in which words they say why.

use crate::dialect::{HEARTBEAT_DATA, MavAutopilot, MavType};
use protocol::control_level::Danger;

/// An autopilot that can be commanded.
#[derive(Debug, PartialEq)]
pub struct Profile {
    /// Its usual name.
    pub name: &'static str,
    /// Its firmware in the heartbeat.
    pub heartbeat: MavAutopilot,
    /// Types of vehicle in the heartbeat that it flies.
    pub types: &'static [MavType],
    /// The same firmware on a multirotor; none: this is it.
    pub multirotor: Option<&'static Profile>,
    /// Its modes.
    pub modes: Modes,
    /// Meaning of its commands.
    pub commands: Commands,
    /// The parameters that are looked at.
    pub parameters: Parameters,
    /// Its words for what sends it home by itself; the first that fits.
    pub causes: &'static [Saying],
    /// Messages that it alone has, with the rate at which they are asked for, 1/s.
    pub messages: &'static [(u32, f64)],
    /// Notice for its pilot; empty: none.
    pub caution: &'static str,
}

/// Flight modes, by HEARTBEAT.custom_mode.
#[derive(Debug, PartialEq)]
pub struct Modes {
    /// Still starting up.
    pub starting: u32,
    /// Takes off and climbs by itself.
    pub take_off: u32,
    /// In which it goes on by itself after that climb, if it does.
    pub after_take_off: Option<u32>,
    /// Flies to the places that a ground station sends.
    pub places: u32,
    /// Whether a pilot uses that mode as well, so that one found in it is not the bridge's.
    pub places_is_pilots: bool,
    /// Obeys attitude and thrust that a ground station sends.
    pub attitudes: u32,
    /// Whether it takes that mode only while they come already.
    pub attitudes_first: bool,
    /// Returns home.
    pub home: u32,
    /// Shown while it flies the landing sequence on board upon DO_LAND_START; none: it lands as its way home ends.
    pub landing: Option<u32>,
    /// In which it brings itself home.
    pub homeward: &'static [u32],
    /// Numbers and names.
    pub names: &'static [(u32, &'static str)],
    /// Whether the number holds a main mode (bits 16 to 23) and a sub mode (24 to 31), as DO_SET_MODE then does.
    pub in_parts: bool,
}

/// Meaning of its commands.
#[derive(Debug, PartialEq)]
pub struct Commands {
    /// Airspeed comes with each place, in DO_REPOSITION, where DO_CHANGE_SPEED does not reach.
    pub speed_with_place: bool,
    /// The fourth parameter of DO_REPOSITION that leaves it as it is.
    pub reposition_4: f32,
    /// The type mask of SET_ATTITUDE_TARGET with which it takes roll, pitch and thrust, and no more.
    pub attitude_mask: u8,
    /// PARAM_VALUE and PARAM_SET carry the bytes of a whole number, not its value as a float.
    pub parameters_as_bytes: bool,
    /// It takes off by NAV_TAKEOFF in the mode for places, once it is armed; else by a mode of its own.
    pub take_off_by_command: bool,
    /// Speeds are over ground; else equivalent airspeeds.
    pub ground_speed: bool,
    /// MAV_STATE_ACTIVE means that it flies; else that it is armed.
    pub active_flies: bool,
}

/// Names of parameters; of several the first that it has.
#[derive(Debug, PartialEq)]
pub struct Parameters {
    /// Altitude above home to which it takes off by itself, m; empty: it is commanded.
    pub take_off_altitude: &'static str,
    /// Lowest equivalent airspeed, m/s.
    pub airspeed_min: &'static [&'static str],
    /// Highest equivalent airspeed, m/s.
    pub airspeed_max: &'static [&'static str],
    /// Altitude above home of its way home, with m for 1 of its unit.
    pub home_altitude: &'static [(&'static str, f64)],
    /// Id of the ground station whose heartbeat counts; none: that of any.
    pub station: &'static [&'static str],
    /// The others.
    pub rules: &'static [Rule],
}

/// Expected value of a parameter.
#[derive(Debug, PartialEq)]
pub struct Rule {
    /// Its subject.
    pub about: &'static str,
    /// Its name.
    pub name: &'static str,
    /// Meaning of its values.
    pub meanings: &'static [(i32, Meaning)],
    /// Meaning of any other value.
    pub otherwise: Meaning,
    /// Value written by `--set-parameters`; none: never written.
    pub set_to: Option<f64>,
    /// Whether it says what becomes of it without this bridge.
    pub link_failsafe: bool,
}

/// Meaning of a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Meaning {
    /// As it should be.
    Right(&'static str),
    /// Needs a person's attention; with the expected value.
    Doubtful(&'static str),
}

/// Types of vehicle that a wing carries.
pub const FIXED_WINGS: &[MavType] = &[MavType::MAV_TYPE_FIXED_WING, MavType::MAV_TYPE_GENERIC];
/// Types of vehicle that rotors carry.
pub const MULTIROTORS: &[MavType] = &[
    MavType::MAV_TYPE_QUADROTOR,
    MavType::MAV_TYPE_HEXAROTOR,
    MavType::MAV_TYPE_OCTOROTOR,
    MavType::MAV_TYPE_TRICOPTER,
    MavType::MAV_TYPE_COAXIAL,
    MavType::MAV_TYPE_DODECAROTOR,
    MavType::MAV_TYPE_DECAROTOR,
];

impl Profile {
    /// The profile of the vehicle that sends a heartbeat: of the same firmware, on a wing or on rotors; none of another
    /// firmware or type.
    pub fn of_heartbeat(&'static self, heartbeat: &HEARTBEAT_DATA) -> Option<&'static Self> {
        let fits = |profile: &&'static Self| {
            heartbeat.autopilot == profile.heartbeat && profile.types.contains(&heartbeat.mavtype)
        };
        Some(self).filter(fits).or(self.multirotor.filter(fits))
    }
}

impl Rule {
    /// Meaning of `value`.
    pub fn meaning(&self, value: f64) -> Meaning {
        let known = self.meanings.iter().find(|(v, _)| f64::from(*v) == value);
        known.map_or(self.otherwise, |(_, meaning)| *meaning)
    }
}

/// Words that tell a cause: all of `all` are in the text and, where `any` is not empty, one of these.
#[derive(Debug, PartialEq)]
pub struct Saying {
    /// In small letters.
    pub all: &'static [&'static str],
    /// In small letters.
    pub any: &'static [&'static str],
    /// The cause.
    pub danger: Danger,
}

impl Saying {
    /// Whether a text in small letters says so.
    pub fn is_in(&self, text: &str) -> bool {
        let has = |part: &&str| text.contains(*part);
        self.all.iter().all(has) && (self.any.is_empty() || self.any.iter().any(has))
    }
}

impl Modes {
    /// A mode's name alone, for people.
    pub fn short_name(&self, custom_mode: u32) -> String {
        let known = self.names.iter().find(|(mode, _)| *mode == custom_mode);
        known.map_or_else(|| format!("mode {custom_mode}"), |(_, name)| (*name).into())
    }

    /// A mode's name, with its number where people know it by that.
    pub fn name(&self, custom_mode: u32) -> String {
        let name = self.short_name(custom_mode);
        if self.in_parts || name.starts_with("mode ") {
            return name;
        }
        format!("{name} ({custom_mode})")
    }

    /// Whether it brings itself home in that mode.
    pub fn is_homeward(&self, custom_mode: u32) -> bool {
        self.homeward.contains(&custom_mode)
    }

    /// The second and third parameter of DO_SET_MODE for that mode.
    pub fn parameters(&self, custom_mode: u32) -> [f32; 2] {
        if self.in_parts {
            [
                ((custom_mode >> 16) & 0xFF) as f32,
                (custom_mode >> 24) as f32,
            ]
        } else {
            [custom_mode as f32, 0.0]
        }
    }
}
