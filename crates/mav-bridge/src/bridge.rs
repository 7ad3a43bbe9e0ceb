//! The bridge: its inputs, its outputs and their timing.

pub(crate) mod attitude;
mod batteries;
mod causes;
pub(crate) mod checklist;
mod config;
mod fence;
mod fence_transfer;
pub(crate) mod gas;
mod health;
mod identity;
mod output;
mod paths;
mod placement;
mod rates;
mod receiving;
mod speed;
mod steering;
mod texts;

pub use self::config::BridgeConfig;
pub use self::output::BridgeOutput;

use self::attitude::Stream;
use self::causes::{Causes, OwnSilence};
use self::checklist::Checklist;
use self::fence::FenceExchange;
use self::gas::GasHeard;
use self::identity::Identity;
use self::paths::Paths;
use self::placement::Placement;
use self::rates::Rates;
use self::speed::CommandedSpeed;
use self::texts::Texts;
use crate::authority::{Authority, BridgePhase};
use crate::command_queue::CommandQueue;
use crate::dialect::{HEARTBEAT_DATA, MavAutopilot, MavModeFlag, MavState, MavType};
use crate::error::BridgeError;
use crate::event::event;
use crate::telemetry::Telemetry;
use crate::wire::signing::{Signing, SigningConfig};
use crate::wire::{FrameEncoder, LinkStatistics};
use mavlink::MessageData;
use protocol::control_level::{ControlEvent, ControlOutcome, ControlState};
use protocol::message::{ControlLevel, PathKind, Setpoint, Severity};
use protocol::{Pauses, SimTime};
use std::collections::{BTreeMap, BTreeSet};

/// Period of the ground station's heartbeat, ns, which a vehicle's failsafe monitors.
const HEARTBEAT_NS: i64 = 1_000_000_000;

/// Warnings that the team has received; each is given once.
#[derive(Debug, Clone, Default)]
struct Warned {
    no_frames: bool,
    silent_telemetry: bool,
    battery: bool,
    /// By their ids.
    other_batteries: BTreeSet<u8>,
    signature: bool,
    unsigned: bool,
    waits_for_arming: bool,
    take_off_refused: bool,
    mission_over: bool,
}

/// A vehicle on the other side of a MAVLink link.
#[derive(Debug, Clone)]
pub struct Bridge {
    config: BridgeConfig,
    paths: Paths,
    encoder: FrameEncoder,
    signing: Option<Signing>,
    telemetry: Telemetry,
    authority: Authority,
    commands: CommandQueue,
    identity: Identity,
    gas: GasHeard,
    causes: Causes,
    checklist: Checklist,
    fence: FenceExchange,
    rates: Rates,
    placement: Placement,
    stream: Stream,
    /// A hand-back waits with its mode until attitudes are there.
    mode_waits: bool,
    /// Frames that could not be read or were refused.
    lost: LinkStatistics,
    /// The last report on the link, and its time.
    told: (SimTime, LinkStatistics),
    next_heartbeat: SimTime,
    heartbeat_at: Option<SimTime>,
    /// Start of the silence without heartbeats, without the pauses of this host.
    silent_since: SimTime,
    /// The mode that the vehicle has left last, and when.
    mode_left: Option<(u32, SimTime)>,
    /// The vehicle's own time as last received, ms.
    boot_ms: u32,
    /// A hand-back on the ground: the next setpoint may begin with a take-off.
    rejoins: bool,
    pauses: Pauses,
    own_silence: OwnSilence,
    /// When the vehicle was seen to return home for a cause that it has not told yet.
    cause_awaited: Option<SimTime>,
    connected_at: SimTime,
    /// The setpoint followed, or to be followed after take-off.
    target: Option<Setpoint>,
    ignored: Option<Setpoint>,
    speed: CommandedSpeed,
    /// Time of the next request after a rejected or unanswered one.
    retry_at: Option<SimTime>,
    takeoff_altitude_m: Option<f64>,
    /// Parameters received from the vehicle.
    parameters: BTreeMap<String, f64>,
    /// Texts that may come again over another link.
    last_texts: Vec<(String, SimTime)>,
    texts: Texts,
    /// Frames that a dry run has logged.
    shown: BTreeSet<Vec<u8>>,
    warned: Warned,
}

/// The mode in which setpoints go through.
fn guided_mode(config: &BridgeConfig) -> u32 {
    let modes = &config.profile.modes;
    if config.attitude_targets {
        modes.attitudes
    } else {
        modes.places
    }
}

impl Bridge {
    /// A bridge by `config` that has neither received nor sent anything yet.
    ///
    /// # Errors
    /// [`BridgeError::OutOfRange`].
    pub fn new(config: BridgeConfig) -> Result<Self, BridgeError> {
        let config = config.validated()?;
        let mut authority = Authority::new(&config.profile.modes, guided_mode(&config));
        if config.listen_only {
            authority.watch("listen-only mode");
        }
        Ok(Self {
            paths: Paths::default(),
            encoder: FrameEncoder::new(config.system_id, config.component_id),
            signing: config.signing.clone().map(Signing::new),
            telemetry: Telemetry::new(config.atmosphere, config.profile.commands.active_flies),
            authority,
            commands: CommandQueue::default(),
            identity: Identity::new(&config),
            gas: GasHeard::new(config.gas, &config.gas_inputs),
            causes: Causes::default(),
            checklist: Checklist::new(&config),
            fence: FenceExchange::new(config.expectation.as_ref().map_or(&[], |e| &e.fence)),
            rates: Rates::default(),
            placement: Placement::default(),
            stream: Stream::default(),
            mode_waits: false,
            lost: LinkStatistics::default(),
            told: (SimTime::ZERO, LinkStatistics::default()),
            next_heartbeat: SimTime::from_ns(i64::MIN),
            heartbeat_at: None,
            silent_since: SimTime::ZERO,
            mode_left: None,
            boot_ms: 0,
            rejoins: false,
            pauses: Pauses::default(),
            own_silence: OwnSilence::default(),
            cause_awaited: None,
            connected_at: SimTime::ZERO,
            target: None,
            ignored: None,
            speed: CommandedSpeed::default(),
            retry_at: None,
            takeoff_altitude_m: None,
            parameters: BTreeMap::new(),
            last_texts: Vec::new(),
            texts: Texts::default(),
            shown: BTreeSet::new(),
            warned: Warned::default(),
            config,
        })
    }

    /// From now on frames out are signed, and frames in that are not are refused.
    pub fn sign(&mut self, config: SigningConfig) {
        self.signing = Some(Signing::new(config));
    }

    /// The configured system id of the vehicle.
    pub fn system_id(&self) -> Option<u8> {
        self.config.vehicle_system_id
    }

    /// Whether the vehicle has been received.
    pub fn is_heard(&self) -> bool {
        self.heartbeat_at.is_some()
    }

    /// Takes in what has come over its links so far that was no frame, where somebody else has looked for the
    /// frames and handed on those alone.
    pub fn no_frames(&mut self, so_far: LinkStatistics) {
        self.paths.no_frames(so_far);
    }

    /// Counters of the link.
    pub fn statistics(&self) -> LinkStatistics {
        LinkStatistics {
            unreadable_frames: self.lost.unreadable_frames,
            refused_frames: self.lost.refused_frames,
            duplicate_frames: self.lost.duplicate_frames,
            ..self.paths.statistics()
        }
    }

    /// The control level, with the dangers that last.
    pub fn control(&self) -> &ControlState {
        self.authority.control()
    }

    /// The control level.
    pub fn level(&self) -> ControlLevel {
        self.control().level()
    }

    /// The vehicle's activity as text.
    pub fn doing(&self) -> String {
        self.authority.doing()
    }

    /// Whether setpoints go through now.
    pub fn follows_setpoints(&self) -> bool {
        self.level() == ControlLevel::Automatic
            && self.authority.link_up()
            && self.identity.is_certain()
            && self.checklist.is_done()
    }

    /// Whether the mode for setpoints has been asked for upon a hand-back and the vehicle has not shown it yet;
    /// until then the level is still the pilot's.
    pub fn hand_back_pending(&self) -> bool {
        self.authority.phase() == BridgePhase::HandingBack
    }

    /// Receives `bytes` from the link: a datagram, or any part of a stream.
    pub fn receive(&mut self, bytes: &[u8], now: SimTime, out: &mut BridgeOutput) {
        self.receive_over(0, bytes, now, out);
    }

    /// The same from one of several links to the vehicle, counted from 0: what comes over more than one of them
    /// counts once.
    pub fn receive_over(
        &mut self,
        link: usize,
        bytes: &[u8],
        now: SimTime,
        out: &mut BridgeOutput,
    ) {
        self.paths.push(link, bytes);
        self.process_frames(now, out);
    }

    /// Which of several links frames for the vehicle are to be sent over; those that
    /// [`crate::goes_over_all_links`] are for all of them.
    pub fn best_link(&mut self, now: SimTime) -> usize {
        self.paths.best(now)
    }

    /// Advances time: heartbeat, repeated commands, silence. Call it every tick.
    pub fn tick(&mut self, now: SimTime, out: &mut BridgeOutput) {
        self.process_frames(now, out);
        self.identity.tick(now);
        let pause_ns = self.pauses.tick(now);
        self.silent_since = self.silent_since.later(pause_ns).min(now);
        self.gas.pause(pause_ns, now);
        out.events.extend(self.texts.counted(now));
        self.check_timeouts(now, out);
        self.report_failsafe(now, out);
        self.check_placement(now, out);
        self.check_airspeed(now, out);
        self.check_attitudes(now, out);
        self.report_link(now, out);
        self.exchange_fence(now, out);
        self.go_through_checklist(now, out);
        self.continue_phase(now, out);
        self.send_heartbeat(now, out);
        self.check_rates(now, out);
        self.send_commands(now, out);
    }

    fn send_heartbeat(&mut self, now: SimTime, out: &mut BridgeOutput) {
        if now < self.next_heartbeat {
            return;
        }
        self.next_heartbeat = SimTime::from_ns(now.ns().saturating_add(HEARTBEAT_NS));
        self.own_silence.speaks(now);
        let heartbeat = ground_station_heartbeat();
        if self.config.dry_run {
            self.show("HEARTBEAT, every second", &heartbeat, now, out);
        } else {
            self.send(&heartbeat, now, out);
        }
    }

    /// Lets time pass for a vehicle that the team has let go: it gets the heartbeat and nothing else, so that its
    /// failsafe for a lost ground station does not take it from its pilot.
    pub fn keep_alive(&mut self, now: SimTime, out: &mut BridgeOutput) {
        self.process_frames(now, out);
        self.send_heartbeat(now, out);
    }

    /// Another ground station whose heartbeat the vehicle's failsafe monitors, if received in the last
    /// seconds: the vehicle then does not need this bridge's heartbeat.
    pub fn other_station(&self, now: SimTime) -> Option<u8> {
        let names = self.config.profile.parameters.station;
        let told = names.iter().find_map(|name| self.parameters.get(*name));
        let own = f64::from(self.config.system_id);
        let wanted = told.copied().unwrap_or(own);
        let mut heard = self.identity.stations(now);
        heard.find(|id| names.is_empty() || f64::from(*id) == wanted)
    }

    /// Whether nothing is sent to the vehicle that it would miss.
    pub fn is_onlooker(&self) -> bool {
        self.config.listen_only || self.config.dry_run
    }

    /// Something happens to the control level that the vehicle's own messages do not show: a
    /// danger that the rest of the team sees, or a hand-back.
    pub fn handle(&mut self, change: ControlEvent, out: &mut BridgeOutput) {
        if change == ControlEvent::HandBack {
            return self.hand_back(out);
        }
        let before = self.authority.phase();
        self.authority.handle(change);
        if matches!(change, ControlEvent::Ends(_)) && self.authority.resumes() {
            let text = "the silent agents publish again: automatic flight resumes";
            out.events.push(event(Severity::Info, "resumed", text));
            return self.hand_back(out);
        }
        let phase = self.authority.phase();
        if phase == before {
            return;
        }
        self.on_phase(phase);
        if phase == BridgePhase::Guardian {
            let dangers: Vec<&str> = self.control().dangers().map(|d| d.description()).collect();
            let text = format!("the Guardian brings it home: {}", dangers.join(", "));
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
        if !self.identity.is_certain() && self.authority.phase() != BridgePhase::Watched {
            let why = "the bridge still checks for a second vehicle on this link";
            return self.ignore(setpoint, "setpoint-ignored", why, out);
        }
        if !self.checklist.is_done() && self.authority.phase() != BridgePhase::Watched {
            let why = "the checklist before take-off is not complete";
            return self.ignore(setpoint, "setpoint-ignored", why, out);
        }
        match (self.authority.phase(), setpoint.path) {
            (BridgePhase::Ground, PathKind::TakeOff) => self.take_off(setpoint, now, out),
            // Handed back on the ground, as after a restart, it joins the others by a take-off.
            (BridgePhase::Ground, PathKind::GoTo | PathKind::Orbit) if self.rejoins => {
                self.take_off(setpoint, now, out);
            }
            // The vehicle has landed already.
            (BridgePhase::Ground, PathKind::Land) => {}
            (BridgePhase::Ground, _) => {
                let why = "the vehicle is on the ground; hand it back to let it take off";
                self.ignore(setpoint, "setpoint-ignored", why, out);
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
                    "the vehicle is returning home to land",
                    out,
                );
            }
            (phase, _) => {
                let why = match phase {
                    BridgePhase::HandingBack => "the vehicle has not confirmed the hand-back yet",
                    BridgePhase::Guardian => "the Guardian flies",
                    BridgePhase::Watched => "the vehicle is only monitored",
                    _ => "a pilot flies",
                };
                self.ignore(setpoint, "setpoint-ignored", why, out);
            }
        }
    }

    /// Returns the vehicle to automatic flight, on behalf of its pilot or operator: the mode for setpoints
    /// is asked for once, and setpoints go through when the vehicle shows it. The answer is an event:
    /// `hand-back` or `guided` if it is done, `hand-back-refused` or `hand-back-failed` if not.
    pub fn hand_back(&mut self, out: &mut BridgeOutput) {
        let mut say = |severity, code, text: &str| out.events.push(event(severity, code, text));
        let Some(seen) = self.authority.shown().filter(|_| self.authority.link_up()) else {
            let text = "hand-back rejected: no link to the vehicle";
            return say(Severity::Warning, "hand-back-refused", text);
        };
        match self.authority.phase() {
            BridgePhase::Watched => {
                let text = format!("hand-back rejected: {}", self.authority.doing());
                say(Severity::Warning, "hand-back-refused", &text);
            }
            phase @ (BridgePhase::Ground
            | BridgePhase::TakeOff
            | BridgePhase::Guided
            | BridgePhase::Landing) => {
                self.rejoins |= phase == BridgePhase::Ground;
                let text = "hand-back ignored: the vehicle is in automatic flight already";
                say(Severity::Info, "hand-back", text);
            }
            _ if !seen.airborne && !seen.armed => {
                self.commands.drop_steering();
                let outcome = self.authority.hand_back_on_ground();
                self.rejoins = self.authority.phase() == BridgePhase::Ground;
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
                match phase {
                    BridgePhase::HandingBack => {
                        // Asked for once it is ready for it.
                        self.mode_waits = true;
                        let mode = self.authority.guided_mode();
                        let name = self.authority.modes().short_name(mode);
                        let text = format!("handed back: {name} requested");
                        out.events
                            .push(event(Severity::Info, "hand-back-pending", text));
                    }
                    BridgePhase::Guardian if outcome == ControlOutcome::Taken => {
                        let text = "handed back to the Guardian, not to automatic flight, since a danger persists";
                        out.events
                            .push(event(Severity::Warning, "hand-back-refused", text));
                    }
                    _ => self.report_hand_back(outcome, "handed back to automatic flight", out),
                }
            }
        }
    }

    /// Whether the vehicle is in the air or its motor may run, by its last telemetry.
    pub fn is_up(&self) -> bool {
        self.authority
            .shown()
            .is_some_and(|s| s.airborne || s.armed)
    }

    /// Ends the mission. A vehicle under the bridge's control comes home to land; others stay with their pilot.
    /// Keep the bridge until the vehicle is down ([`Bridge::is_up`]).
    pub fn mission_over(&mut self, out: &mut BridgeOutput) {
        if !self.is_up() || std::mem::replace(&mut self.warned.mission_over, true) {
            return;
        }
        let then = match self.authority.phase() {
            BridgePhase::TakeOff | BridgePhase::Guided => {
                self.come_down();
                "it returns home to land"
            }
            BridgePhase::Landing => "it returns home to land",
            BridgePhase::Guardian => {
                "the Guardian brings it home; to land it, a pilot takes over or an operator \
                                      hands it back"
            }
            BridgePhase::Watched => "it is only monitored",
            _ => "its pilot lands it",
        };
        let text =
            format!("the mission is over, but the vehicle is still armed or airborne: {then}");
        out.events
            .push(event(Severity::Warning, "mission-over", text));
    }

    fn report_hand_back(&self, outcome: ControlOutcome, done: &str, out: &mut BridgeOutput) {
        out.events.push(match outcome {
            ControlOutcome::Refused(danger) => event(
                Severity::Warning,
                "hand-back-refused",
                format!("hand-back rejected: {}", danger.description()),
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
        (self.target, self.ignored) = (None, None);
        self.speed.forget();
        self.retry_at = None;
    }

    /// Logs a frame that is not sent, once for each kind.
    fn show<D: MessageData>(
        &mut self,
        name: &str,
        message: &D,
        now: SimTime,
        out: &mut BridgeOutput,
    ) {
        if self.config.listen_only {
            return;
        }
        // Not by the encoder that sends: numbers and signatures would be missing there.
        let frame = FrameEncoder::new(self.config.system_id, self.config.component_id)
            .encode(message, None, now);
        if self.shown.insert(frame.clone()) {
            let hex: String = frame.iter().map(|b| format!("{b:02x}")).collect();
            let text = format!("dry run: would send {name}: {hex}");
            out.events.push(event(Severity::Info, "would-send", text));
        }
    }

    fn send<D: MessageData>(&mut self, message: &D, now: SimTime, out: &mut BridgeOutput) {
        if self.config.listen_only {
            return;
        }
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
