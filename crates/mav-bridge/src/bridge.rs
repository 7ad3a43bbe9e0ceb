//! The bridge itself: what comes in, what goes out, when.

mod receiving;
mod steering;

use crate::arduplane::GUIDED;
use crate::authority::{Authority, BridgePhase};
use crate::command_queue::{CommandQueue, VehicleCommand};
use crate::dialect::{HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType};
use crate::error::BridgeError;
use crate::event::event;
use crate::telemetry::Telemetry;
use crate::wire::signing::{Signing, SigningConfig};
use crate::wire::{FrameDecoder, FrameEncoder, LinkStatistics};
use air::isa::Atmosphere;
use mavlink::MessageData;
use plume::Gas;
use protocol::SimTime;
use protocol::control_level::{ControlEvent, ControlOutcome, ControlState};
use protocol::message::{ControlLevel, EventMessage, PathKind, Reading, Setpoint, Severity, State};

/// Period of the ground station's heartbeat, ns: what a vehicle's failsafe listens for.
const HEARTBEAT_NS: i64 = 1_000_000_000;

/// How a bridge behaves. [`BridgeConfig::default`] suits a real ArduPlane.
#[derive(Debug, Clone)]
pub struct BridgeConfig {
    /// Own system id, that of a ground station; the vehicle's failsafe listens for this one.
    pub system_id: u8,
    /// Own component id.
    pub component_id: u8,
    /// System id of the vehicle; none takes the first autopilot received.
    pub vehicle_system_id: Option<u8>,
    /// The site's atmosphere, for true airspeed.
    pub atmosphere: Atmosphere,
    /// The gas whose readings count: those named as its formula in ppm ("CH4"), or with "_PPB" after it in ppb.
    pub gas: Gas,
    /// Whether the bridge may arm the motor at take-off. Off by default: a person does that.
    pub may_arm: bool,
    /// Rate of position, attitude and airspeed asked for, 1/s (1 to 50).
    pub telemetry_hz: f64,
    /// Silence after which the link counts as lost, s.
    pub link_timeout_s: f64,
    /// Time to wait for the answer to a command, s.
    pub ack_timeout_s: f64,
    /// How often a command is sent before it is given up.
    pub attempts: u32,
    /// Height above home at which GUIDED follows TAKEOFF if the vehicle does not report its
    /// TKOFF_ALT, m.
    pub guided_above_home_m: f64,
    /// Key shared with the vehicle: frames out are signed, unsigned ones in are refused.
    pub signing: Option<SigningConfig>,
}

impl Default for BridgeConfig {
    fn default() -> Self {
        Self {
            system_id: 255,
            component_id: 190, // MAV_COMP_ID_MISSIONPLANNER: a ground station
            vehicle_system_id: None,
            atmosphere: Atmosphere::standard(),
            gas: Gas::Co2,
            may_arm: false,
            telemetry_hz: 10.0,
            link_timeout_s: 5.0,
            ack_timeout_s: 1.0,
            attempts: 5,
            guided_above_home_m: 40.0,
            signing: None,
        }
    }
}

impl BridgeConfig {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`BridgeError::OutOfRange`].
    pub fn validated(self) -> Result<Self, BridgeError> {
        let checks = [
            ("telemetry_hz", self.telemetry_hz, 1.0, 50.0, "1 to 50"),
            (
                "link_timeout_s",
                self.link_timeout_s,
                1.5,
                60.0,
                "1.5 to 60 s",
            ),
            (
                "ack_timeout_s",
                self.ack_timeout_s,
                0.05,
                10.0,
                "0.05 to 10 s",
            ),
            ("attempts", f64::from(self.attempts), 1.0, 100.0, "1 to 100"),
            (
                "guided_above_home_m",
                self.guided_above_home_m,
                10.0,
                500.0,
                "10 to 500 m",
            ),
        ];
        for (what, value, low, high, expected) in checks {
            if !(low..=high).contains(&value) {
                return Err(BridgeError::OutOfRange {
                    what,
                    value,
                    expected,
                });
            }
        }
        Ok(self)
    }
}

/// What came of a call; empty it, or make a new one, for each call.
#[derive(Debug, Clone, Default)]
pub struct BridgeOutput {
    /// Frames to send to the vehicle, in order.
    pub frames_to_vehicle: Vec<Vec<u8>>,
    /// Frames that came from the link and had a valid checksum, in order.
    pub frames_from_vehicle: Vec<Vec<u8>>,
    /// The vehicle's state, if a new position came; the last of several.
    pub state: Option<State>,
    /// What its sensor reads, if a new reading came; the last of several.
    pub reading: Option<Reading>,
    /// What happened.
    pub events: Vec<EventMessage>,
}

impl BridgeOutput {
    /// Takes everything out, so that it can be used again.
    pub fn clear(&mut self) {
        self.frames_to_vehicle.clear();
        self.frames_from_vehicle.clear();
        self.events.clear();
        (self.state, self.reading) = (None, None);
    }
}

/// What the team has been warned of; each warning is given once.
#[derive(Debug, Clone, Default)]
struct Warned {
    no_frames: bool,
    silent_telemetry: bool,
    battery: bool,
    signature: bool,
    waits_for_arming: bool,
}

/// A vehicle on the other side of a MAVLink link.
#[derive(Debug, Clone)]
pub struct Bridge {
    config: BridgeConfig,
    decoder: FrameDecoder,
    encoder: FrameEncoder,
    signing: Option<Signing>,
    telemetry: Telemetry,
    authority: Authority,
    commands: CommandQueue,
    vehicle: Option<u8>,
    last_sequence: Option<u8>,
    lost: LinkStatistics,
    next_heartbeat: SimTime,
    heartbeat_at: Option<SimTime>,
    connected_at: SimTime,
    /// The setpoint followed, or to be followed after take-off.
    target: Option<Setpoint>,
    ignored: Option<Setpoint>,
    speed_sent: Option<f32>,
    /// When something refused or unanswered may be asked for again.
    retry_at: Option<SimTime>,
    takeoff_altitude_m: Option<f64>,
    warned: Warned,
}

impl Bridge {
    /// A bridge by `config` that has neither received nor sent anything yet.
    ///
    /// # Errors
    /// [`BridgeError::OutOfRange`].
    pub fn new(config: BridgeConfig) -> Result<Self, BridgeError> {
        let config = config.validated()?;
        Ok(Self {
            decoder: FrameDecoder::new(),
            encoder: FrameEncoder::new(config.system_id, config.component_id),
            signing: config.signing.clone().map(Signing::new),
            telemetry: Telemetry::new(config.atmosphere),
            authority: Authority::new(),
            commands: CommandQueue::default(),
            vehicle: config.vehicle_system_id,
            last_sequence: None,
            lost: LinkStatistics::default(),
            next_heartbeat: SimTime::from_ns(i64::MIN),
            heartbeat_at: None,
            connected_at: SimTime::ZERO,
            target: None,
            ignored: None,
            speed_sent: None,
            retry_at: None,
            takeoff_altitude_m: None,
            warned: Warned::default(),
            config,
        })
    }

    /// From now on frames out are signed, and frames in that are not are refused.
    pub fn sign(&mut self, config: SigningConfig) {
        self.signing = Some(Signing::new(config));
    }

    /// What has gone over the link so far.
    pub fn statistics(&self) -> LinkStatistics {
        let LinkStatistics {
            lost_frames,
            unreadable_frames,
            refused_frames,
            ..
        } = self.lost;
        LinkStatistics {
            lost_frames,
            unreadable_frames,
            refused_frames,
            ..self.decoder.statistics()
        }
    }

    /// The control level, with the dangers that last.
    pub fn control(&self) -> &ControlState {
        self.authority.control()
    }

    /// Who flies.
    pub fn level(&self) -> ControlLevel {
        self.control().level()
    }

    /// What the vehicle does, as text for people.
    pub fn doing(&self) -> String {
        self.authority.doing()
    }

    /// Whether setpoints go through now.
    pub fn follows_setpoints(&self) -> bool {
        self.level() == ControlLevel::Automatic && self.authority.link_up()
    }

    /// Whether GUIDED has been asked for upon a hand-back and the vehicle has not shown it yet;
    /// until then the level is still the pilot's.
    pub fn hand_back_pending(&self) -> bool {
        self.authority.phase() == BridgePhase::HandingBack
    }

    /// Takes in `bytes` from the link: a datagram, or a piece of a stream cut anywhere.
    pub fn receive(&mut self, bytes: &[u8], now: SimTime, out: &mut BridgeOutput) {
        self.decoder.push(bytes);
        self.process_frames(now, out);
    }

    /// Lets time pass: heartbeat, commands to repeat, silence. To be called every tick.
    pub fn tick(&mut self, now: SimTime, out: &mut BridgeOutput) {
        self.process_frames(now, out);
        self.check_timeouts(now, out);
        self.continue_phase(now, out);
        if now >= self.next_heartbeat {
            self.next_heartbeat = SimTime::from_ns(now.ns().saturating_add(HEARTBEAT_NS));
            let heartbeat = ground_station_heartbeat();
            self.send(&heartbeat, now, out);
        }
        self.send_commands(now, out);
    }

    /// Something happens to the control level that the vehicle's own messages do not show: a
    /// danger that the rest of the team sees, or a hand-back.
    pub fn handle(&mut self, change: ControlEvent, out: &mut BridgeOutput) {
        if change == ControlEvent::HandBack {
            return self.hand_back(out);
        }
        let before = self.authority.phase();
        self.authority.handle(change);
        let phase = self.authority.phase();
        if phase == before {
            return;
        }
        self.on_phase(phase);
        if phase == BridgePhase::Guardian {
            let dangers: Vec<&str> = self.control().dangers().map(|d| d.description()).collect();
            let text = format!("brought home: {}", dangers.join(", "));
            out.events.push(event(Severity::Warning, "guardian", text));
        }
    }

    /// Passes a setpoint on, or withholds it with an event. A setpoint like the last one is not
    /// sent again; it may be given every tick.
    pub fn setpoint(&mut self, setpoint: &Setpoint, now: SimTime, out: &mut BridgeOutput) {
        if let Some(why) = unusable(setpoint) {
            return self.ignore(setpoint, "bad-setpoint", why, out);
        }
        if !self.authority.link_up() {
            return self.ignore(setpoint, "setpoint-ignored", "no link to the vehicle", out);
        }
        match (self.authority.phase(), setpoint.path) {
            (BridgePhase::Ground, PathKind::TakeOff) => self.take_off(setpoint, out),
            (BridgePhase::Ground, _) => {
                self.ignore(
                    setpoint,
                    "setpoint-ignored",
                    "the vehicle is on the ground",
                    out,
                );
            }
            (BridgePhase::TakeOff, PathKind::Land) | (BridgePhase::Guided, PathKind::Land) => {
                self.land(setpoint);
            }
            (BridgePhase::TakeOff, _) => self.target = Some(setpoint.clone()),
            (BridgePhase::Guided, _) => self.guide(setpoint, now),
            (BridgePhase::Landing, PathKind::Land) => {}
            (BridgePhase::Landing, _) => {
                self.ignore(
                    setpoint,
                    "setpoint-ignored",
                    "the vehicle comes home to land",
                    out,
                );
            }
            (phase, _) => {
                let why = match phase {
                    BridgePhase::HandingBack => "the vehicle is not in GUIDED yet",
                    BridgePhase::Guardian => "the Guardian flies",
                    BridgePhase::Unsupported => "the vehicle is no ArduPlane",
                    _ => "a pilot flies",
                };
                self.ignore(setpoint, "setpoint-ignored", why, out);
            }
        }
    }

    /// The pilot, or whoever answers for the vehicle, gives it back to automatic flight: GUIDED
    /// is asked for once, and setpoints go through when the vehicle shows it.
    pub fn hand_back(&mut self, out: &mut BridgeOutput) {
        let Some(seen) = self.authority.shown().filter(|_| self.authority.link_up()) else {
            let text = "hand-back without effect: no link to the vehicle";
            return out.events.push(event(Severity::Warning, "hand-back", text));
        };
        match self.authority.phase() {
            BridgePhase::Unsupported
            | BridgePhase::Ground
            | BridgePhase::Guided
            | BridgePhase::Landing => {
                let text = "hand-back without effect: no pilot has taken over";
                out.events.push(event(Severity::Info, "hand-back", text));
            }
            _ if !seen.airborne && !seen.armed => {
                let outcome = self.authority.hand_back_on_ground();
                self.report_hand_back(
                    outcome,
                    "handed back on the ground: waits for take-off",
                    out,
                );
            }
            _ => {
                self.clear_target();
                let outcome = self.authority.hand_back();
                let phase = self.authority.phase();
                self.on_phase(phase);
                if phase == BridgePhase::HandingBack {
                    // Once only: a repetition could cross the pilot's next change of mind.
                    self.commands.push(VehicleCommand::Mode {
                        mode: GUIDED,
                        attempts: 1,
                    });
                }
                let text = match phase {
                    BridgePhase::Guardian => "handed back to the Guardian: a danger lasts",
                    _ => "handed back to automatic flight",
                };
                self.report_hand_back(outcome, text, out);
            }
        }
    }

    fn report_hand_back(&self, outcome: ControlOutcome, done: &str, out: &mut BridgeOutput) {
        out.events.push(match outcome {
            ControlOutcome::Refused(danger) => event(
                Severity::Warning,
                "hand-back-refused",
                format!("hand-back refused: {}", danger.description()),
            ),
            _ => event(Severity::Info, "hand-back", done),
        });
    }

    fn ignore(&mut self, setpoint: &Setpoint, code: &str, why: &str, out: &mut BridgeOutput) {
        // The squadron controller repeats itself; one event per setpoint is enough.
        if self.ignored.as_ref() == Some(setpoint) {
            return;
        }
        self.ignored = Some(setpoint.clone());
        if self.level() != ControlLevel::Automatic {
            self.authority.handle(ControlEvent::Setpoint);
        }
        let text = format!("setpoint ignored: {why}");
        out.events.push(event(Severity::Warning, code, text));
    }

    fn clear_target(&mut self) {
        (self.target, self.ignored, self.speed_sent) = (None, None, None);
        self.retry_at = None;
    }

    fn send<D: MessageData>(&mut self, message: &D, now: SimTime, out: &mut BridgeOutput) {
        let frame = self.encoder.encode(message, self.signing.as_mut(), now);
        out.frames_to_vehicle.push(frame);
    }
}

/// Why no aircraft can follow `setpoint`, if so.
fn unusable(setpoint: &Setpoint) -> Option<&'static str> {
    let Setpoint {
        lat_deg,
        lon_deg,
        alt_amsl_m,
        airspeed_m_s,
        orbit_radius_m,
        ..
    } = *setpoint;
    if !(-90.0..=90.0).contains(&lat_deg) || !(-180.0..=180.0).contains(&lon_deg) {
        Some("its latitude or longitude is not on Earth")
    } else if !(-500.0..=10_000.0).contains(&alt_amsl_m) {
        Some("its altitude is outside -500 to 10000 m")
    } else if !(1.0..=100.0).contains(&airspeed_m_s) {
        Some("its airspeed is outside 1 to 100 m/s")
    } else if !(0.0..=10_000.0).contains(&orbit_radius_m) {
        Some("its orbit radius is outside 0 to 10000 m")
    } else {
        None
    }
}

fn ground_station_heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        // Not the default, which is "armed".
        base_mode: MavModeFlag::empty(),
        custom_mode: 0,
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: 3,
    }
}
