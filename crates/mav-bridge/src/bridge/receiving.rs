//! Messages from the vehicle.

use super::attitude::STEERING_HZ;
use super::batteries::Battery;
use super::causes::CAUSE_WITHIN_S;
use super::checklist;
use super::guided_mode;
use super::identity::Found;
use super::texts::text;
use super::{Bridge, BridgeOutput, Checklist};
use crate::authority::Authority;
use crate::authority::{BridgePhase, HeartbeatState};
use crate::command_queue::VehicleCommand;
use crate::dialect::{
    AIRSPEED_DATA, ATTITUDE_DATA, BATTERY_STATUS_DATA, EXTENDED_SYS_STATE_DATA, EkfStatusFlags,
    GLOBAL_POSITION_INT_DATA, GPS_RAW_INT_DATA, HEARTBEAT_DATA, HOME_POSITION_DATA,
    HYGROMETER_SENSOR_DATA, MavAutopilot, MavMessage, MavParamType, MavSeverity, MavState,
    PARAM_VALUE_DATA, POSITION_TARGET_GLOBAL_INT_DATA, SCALED_PRESSURE_DATA, SYS_STATUS_DATA,
    VFR_HUD_DATA,
};
use crate::event::event;
use crate::profile::{Meaning, Profile};
use crate::wire::RawFrame;
use mavlink::MessageData;
use protocol::SimTime;
use protocol::control_level::{ControlEvent, Danger};
use protocol::message::Severity;

/// Bytes that must have come in without a frame before the team is warned.
const NO_FRAMES_AFTER_BYTES: u64 = 2000;
/// Time limit for requested telemetry, s.
const TELEMETRY_WITHIN_S: f64 = 10.0;
/// Rate of the home position, which changes once, 1/s.
const HOME_HZ: f64 = 0.5;
/// Rate of slowly varying quantities, 1/s.
const SLOW_HZ: f64 = 2.0;
/// A vehicle whose clock goes back by this has started anew, ms: frames of several links overtake each other by less.
const RESTARTED_MS: u32 = 5000;
/// A mode left less than this ago is shown by a heartbeat that another link has delayed, s.
const MODE_SETTLES_S: f64 = 1.0;
/// Time between two reports of what the link loses, s.
const LINK_REPORT_S: f64 = 60.0;

impl Bridge {
    /// Processes all complete frames of the decoders.
    pub(super) fn process_frames(&mut self, now: SimTime, out: &mut BridgeOutput) {
        while let Some((link, frame)) = self.paths.next_frame(now) {
            self.process_frame(link, &frame, now, out);
            // Another vehicle's frames belong to its own record.
            if !self.identity.of_another(&frame) {
                out.frames_from_vehicle.push(frame.into_bytes());
            }
        }
    }

    fn process_frame(
        &mut self,
        link: usize,
        frame: &RawFrame,
        now: SimTime,
        out: &mut BridgeOutput,
    ) {
        if let Some(signing) = &mut self.signing
            && !signing.accepts(frame, now)
        {
            self.lost.refused_frames += 1;
            if !std::mem::replace(&mut self.warned.signature, true) {
                let text = "frames without a valid signature are rejected; check that the vehicle has the same \
                            signing key";
                out.events
                    .push(event(Severity::Error, "signature-refused", text));
            }
            return;
        }
        let Some(message) = frame.message() else {
            // Of another vehicle's frames nobody counts what cannot be read.
            if !self.identity.of_another(frame) {
                self.lost.unreadable_frames += 1;
            }
            return;
        };
        if let MavMessage::HEARTBEAT(heartbeat) = &message {
            let idle = matches!(
                self.authority.phase(),
                BridgePhase::Ground | BridgePhase::Watched
            );
            let committed = self.identity.is_certain() && !idle;
            let found = self.identity.heartbeat(frame, heartbeat, committed, now);
            self.on_found(found, out);
        }
        let Some(from_autopilot) = self.identity.of_vehicle(frame) else {
            return;
        };
        if from_autopilot {
            self.paths.count(link, frame.sequence(), now);
            self.rates.arrived(frame.message_id());
            if frame.is_signed() && self.signing.is_none() {
                self.warn_of_signatures(out);
            }
        }
        match message {
            // A gas sensor may be a component of its own; so may others, whose positions are not the vehicle's.
            MavMessage::NAMED_VALUE_FLOAT(m) => {
                if let Some(read) = self.gas.take(&m, frame.component_id(), now) {
                    let taken = self.telemetry.reading(read.ppm, read.time_boot_ms, now);
                    out.readings.extend(taken);
                }
            }
            MavMessage::HYGROMETER_SENSOR(m) => self.telemetry.hygrometer = Some((now, m)),
            MavMessage::HEARTBEAT(heartbeat) if from_autopilot => {
                self.on_heartbeat(heartbeat, now, out);
            }
            other if from_autopilot => self.on_message(other, now, out),
            _ => {}
        }
    }

    fn on_found(&mut self, found: Found, out: &mut BridgeOutput) {
        let (severity, code, text) = match found {
            Found::Nothing => return,
            Found::Another(system) => (
                Severity::Info,
                "another-vehicle",
                format!(
                    "system {system} also sends on this link; the bridge ignores this other vehicle"
                ),
            ),
            Found::Ambiguous(first, second) => {
                self.authority
                    .watch("two vehicles send on this link, and no system id was given");
                self.commands.clear();
                self.rates = super::Rates::default();
                // Neither is listened to any more, which is no lost link.
                self.heartbeat_at = None;
                (
                    Severity::Error,
                    "two-vehicles",
                    format!(
                        "systems {first} and {second} both send on this link, so neither is commanded; expected \
                         system_id = {first} or {second} for the vehicle in the scenario, or --system-id"
                    ),
                )
            }
            Found::SameStation(component) => {
                let own = self.config.system_id;
                (
                    Severity::Warning,
                    "same-ground-station-id",
                    format!(
                        "another ground station uses system id {own} (component {component}); while it sends, \
                         the vehicle's failsafe does not notice the loss of this bridge; expected a \
                         gcs_system_id (--gcs-id) of the bridge's own, equal to MAV_GCS_SYSID on board \
                         (SYSID_MYGCS before 4.7)"
                    ),
                )
            }
        };
        out.events.push(event(severity, code, text));
    }

    fn warn_of_signatures(&mut self, out: &mut BridgeOutput) {
        if !std::mem::replace(&mut self.warned.unsigned, true) {
            let text = "the vehicle signs its frames and may reject unsigned ones; expected its key (signing_key \
                        of the vehicle in the scenario, or --signing-key)";
            out.events.push(event(Severity::Error, "key-missing", text));
        }
    }

    /// Whether a heartbeat shows a mode that a quicker link has shown as left.
    fn is_stale(&self, custom_mode: u32, now: SimTime) -> bool {
        let left = self.mode_left.filter(|_| self.paths.are_several());
        left.is_some_and(|(mode, at)| mode == custom_mode && now.since_s(at) < MODE_SETTLES_S)
    }

    fn on_heartbeat(&mut self, heartbeat: HEARTBEAT_DATA, now: SimTime, out: &mut BridgeOutput) {
        let first = self.heartbeat_at.is_none();
        let restored = !first && !self.authority.link_up();
        let custom_mode = heartbeat.custom_mode;
        if !first && !restored && self.is_stale(custom_mode, now) {
            return;
        }
        (self.heartbeat_at, self.silent_since) = (Some(now), now);
        let failsafe = matches!(
            heartbeat.system_status,
            MavState::MAV_STATE_CRITICAL | MavState::MAV_STATE_EMERGENCY
        );
        if first {
            self.identify(&heartbeat, out);
        }
        self.telemetry.heartbeat = Some((now, heartbeat));
        if restored {
            let mode = self.config.profile.modes.name(custom_mode);
            let text = format!("heartbeat received again, in {mode}");
            out.events
                .push(event(Severity::Info, "link-restored", text));
        }
        self.commands.mode_seen(custom_mode);
        let before = self.authority.phase();
        let asked = self.authority.unconfirmed();
        let left = self.authority.shown().map(|s| s.custom_mode);
        if let Some(left) = left.filter(|&left| left != custom_mode) {
            self.mode_left = Some((left, now));
        }
        let change = self.authority.observe(HeartbeatState {
            custom_mode,
            armed: self.telemetry.armed(),
            airborne: self.telemetry.airborne(now),
            failsafe,
            cause: self.causes.at(now, failsafe),
            fence_broken: self.causes.fence_broken(),
            unheard: self.own_silence.explains(now),
        });
        if self.authority.awaits_cause() {
            self.cause_awaited.get_or_insert(now);
        }
        out.events.extend(change);
        if asked.is_some_and(|mode| mode != custom_mode) && self.authority.unconfirmed().is_none() {
            self.commands.drop_modes();
        }
        let phase = self.authority.phase();
        if phase != before {
            self.on_phase(phase);
        }
        if first || restored {
            self.connected_at = now;
            self.request_telemetry(now);
            if phase == BridgePhase::Guided {
                self.retry_at = Some(now);
            }
        }
    }

    /// Takes in the vehicle's own time; it goes back when the vehicle has started anew.
    fn on_boot_ms(&mut self, boot_ms: u32, now: SimTime, out: &mut BridgeOutput) {
        let restarted = boot_ms.saturating_add(RESTARTED_MS) < self.boot_ms;
        self.boot_ms = if restarted {
            boot_ms
        } else {
            self.boot_ms.max(boot_ms)
        };
        if !restarted {
            return;
        }
        self.telemetry.restarted();
        self.placement.forget();
        self.speed.forget();
        self.takeoff_altitude_m = None;
        self.parameters.clear();
        self.checklist = Checklist::new(&self.config);
        self.connected_at = now;
        self.request_telemetry(now);
        let text = "the vehicle restarted and has lost the commands sent before";
        out.events.push(event(Severity::Warning, "restarted", text));
    }

    pub(super) fn on_phase(&mut self, phase: BridgePhase) {
        match phase {
            BridgePhase::Pilot | BridgePhase::Guardian | BridgePhase::Ground => {
                self.commands.drop_steering();
                self.clear_target();
                self.rejoins = false;
            }
            BridgePhase::Guided => {
                self.rejoins = false;
                // A commanded speed is forgotten at each change of mode.
                self.speed.forget();
                self.retry_at = self.heartbeat_at;
            }
            _ => {}
        }
    }

    /// Goes on as the bridge of the same firmware on another kind of aircraft.
    fn adopt(&mut self, profile: &'static Profile) {
        if self.config.profile == profile {
            return;
        }
        self.config.profile = profile;
        let guided = guided_mode(&self.config);
        self.authority = Authority::new(&profile.modes, guided);
        if self.config.listen_only {
            self.authority.watch("listen-only mode");
        }
        self.checklist.adopt(profile);
        self.telemetry
            .set_active_flies(profile.commands.active_flies);
    }

    fn identify(&mut self, heartbeat: &HEARTBEAT_DATA, out: &mut BridgeOutput) {
        let (system, component) = self.identity.address().unwrap_or_default();
        let known = self.config.profile.of_heartbeat(heartbeat);
        if let Some(profile) = known {
            self.adopt(profile);
        }
        let profile = self.config.profile;
        let name = profile.name;
        if known.is_some() {
            let own = self.config.system_id;
            let caution = match profile.caution {
                "" => String::new(),
                words => format!("; {words}"),
            };
            let text = format!(
                "{name} found as system {system}, component {component}; this ground station is system \
                 {own}{caution}"
            );
            return out.events.push(event(Severity::Info, "connected", text));
        }
        self.authority.watch("not the configured autopilot");
        let (what, asking) = match heartbeat.autopilot {
            MavAutopilot::MAV_AUTOPILOT_PX4 => ("PX4".to_owned(), Some("px4")),
            MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA => {
                ("ArduPilot".to_owned(), Some("ardupilot"))
            }
            other => (format!("{other:?}"), None),
        };
        let asking = asking.map_or(String::new(), |asking| {
            format!(
                "; to command an aircraft with it, set autopilot = \"{asking}\" for the vehicle"
            )
        });
        let text = format!(
            "system {system} is not {name} ({what}, {:?}): the bridge forwards its telemetry but does not \
             command it, since its flight modes have other numbers{asking}",
            heartbeat.mavtype
        );
        out.events
            .push(event(Severity::Error, "other-autopilot", text));
    }

    fn request_telemetry(&mut self, now: SimTime) {
        if self.config.listen_only {
            return;
        }
        let fast = if self.config.attitude_targets {
            self.config.telemetry_hz.max(STEERING_HZ)
        } else {
            self.config.telemetry_hz
        };
        let wanted = [
            (GLOBAL_POSITION_INT_DATA::ID, fast),
            (ATTITUDE_DATA::ID, fast),
            (VFR_HUD_DATA::ID, fast),
            (SCALED_PRESSURE_DATA::ID, SLOW_HZ),
            (HYGROMETER_SENSOR_DATA::ID, SLOW_HZ),
            (EXTENDED_SYS_STATE_DATA::ID, SLOW_HZ),
            (SYS_STATUS_DATA::ID, 1.0),
            (BATTERY_STATUS_DATA::ID, 1.0),
            (AIRSPEED_DATA::ID, SLOW_HZ),
            (POSITION_TARGET_GLOBAL_INT_DATA::ID, SLOW_HZ),
            (GPS_RAW_INT_DATA::ID, 1.0),
        ];
        let home = (HOME_POSITION_DATA::ID, HOME_HZ);
        let home = self.checklist.is_kept().then_some(home);
        let own = self.config.profile.messages.iter().copied();
        // A multirotor has no airspeed sensor, and so no hygrometer on it.
        let of_airspeed = [HYGROMETER_SENSOR_DATA::ID, AIRSPEED_DATA::ID];
        let rotors = self.config.profile.commands.ground_speed;
        let there = |(id, _): &(u32, f64)| !(rotors && of_airspeed.contains(id));
        let wanted = wanted.into_iter().filter(there).chain(own).chain(home);
        let wanted: Vec<(u32, f64)> = wanted.collect();
        self.rates.start(&wanted, now);
        self.fence.read();
        for name in self.checklist.parameters() {
            self.commands.push(VehicleCommand::Parameter(name));
        }
    }

    /// Goes through the checklist when it is due.
    pub(super) fn go_through_checklist(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let heard = self.heartbeat_at.is_some() && self.authority.link_up();
        if !heard || self.checklist.is_done() {
            return;
        }
        if let Some((_, heartbeat)) = &self.telemetry.heartbeat {
            self.checklist.told.custom_mode = heartbeat.custom_mode;
        }
        let altitude = self.telemetry.position.as_ref().map(|(_, p)| p.alt);
        let alt_amsl_m = f64::from(altitude.unwrap_or_default()) / 1e3;
        self.checklist.told.eas_over_tas = self.telemetry.eas_over_tas(alt_amsl_m, now);
        self.checklist.told.fence = self.fence.found().cloned();
        if self.fence.is_busy() {
            return; // it ends by itself, answered or not
        }
        let due = self.checklist.due(&self.parameters, self.connected_at, now);
        let Some(points) = due else { return };
        out.events.extend(checklist::events(&points));
        let on_ground = self
            .authority
            .shown()
            .is_some_and(|s| !s.airborne && !s.armed);
        if self.config.set_parameters && on_ground {
            for (name, value) in self.checklist.wrong_parameters(&self.parameters) {
                self.commands
                    .push(VehicleCommand::SetParameter { name, value });
            }
        }
    }

    /// Requests messages that do not arrive.
    pub(super) fn check_rates(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let Some(to) = self.identity.address().filter(|_| self.authority.link_up()) else {
            return;
        };
        let due = self.rates.due(now);
        if let Some(command) = due.ask {
            self.send_command(&command, 0, to, now, out);
        }
        if let Some(words) = due.given_up {
            let text = format!("the vehicle does not send at the requested rates: {words}");
            out.events.push(event(Severity::Info, "rate-failed", text));
        }
    }

    fn on_message(&mut self, message: MavMessage, now: SimTime, out: &mut BridgeOutput) {
        let received = &mut self.telemetry;
        match message {
            MavMessage::GLOBAL_POSITION_INT(m) => {
                self.on_boot_ms(m.time_boot_ms, now, out);
                if self.telemetry.take_position(m, now) {
                    out.state = self.telemetry.state(now).or(out.state.take());
                } else {
                    self.lost.duplicate_frames += 1;
                }
            }
            MavMessage::ATTITUDE(m) => {
                let behind =
                    |(_, last): &(SimTime, ATTITUDE_DATA)| m.time_boot_ms < last.time_boot_ms;
                let old =
                    self.paths.are_several() && received.attitude.as_ref().is_some_and(behind);
                if !old {
                    received.attitude = Some((now, m));
                }
            }
            MavMessage::VFR_HUD(m) => received.hud = Some((now, m)),
            MavMessage::WIND(m) => received.wind = Some((now, m)),
            MavMessage::SCALED_PRESSURE(m) => received.pressure = Some((now, m)),
            MavMessage::AIRSPEED(m) => received.airspeed = Some((now, m)),
            MavMessage::GPS_RAW_INT(m) => self.checklist.told.gps = Some(m),
            MavMessage::WIND_COV(m) => received.take_wind(&m, now),
            MavMessage::EKF_STATUS_REPORT(m) => self.checklist.told.ekf = Some(m.flags),
            // The same bits, as far as they are looked at.
            MavMessage::ESTIMATOR_STATUS(m) => {
                self.checklist.told.ekf = Some(EkfStatusFlags::from_bits_truncate(m.flags.bits()));
            }
            MavMessage::HOME_POSITION(m) => self.checklist.told.home = Some(m),
            MavMessage::FENCE_STATUS(m) => self.causes.fence(m.breach_status != 0, now),
            MavMessage::POSITION_TARGET_GLOBAL_INT(m) => self.on_target(&m, now, out),
            MavMessage::EXTENDED_SYS_STATE(m) => received.landed = Some((now, m)),
            MavMessage::COMMAND_ACK(m) => {
                if let Some(outcome) = self.commands.acknowledge(m.command, m.result, now) {
                    self.on_outcome(outcome, now, out);
                }
            }
            MavMessage::PARAM_VALUE(m) => self.on_parameter(&m, out),
            MavMessage::STATUSTEXT(m) => {
                let severity = severity(m.severity);
                let said = text(&m.text[..]);
                self.causes.text(&said, self.config.profile.causes, now);
                self.checklist.told.text(&said);
                if !self.is_repeated(&said, now) {
                    out.events.extend(self.texts.take(severity, &said, now));
                }
            }
            MavMessage::SYS_STATUS(m) => {
                self.causes.status(&m, now);
                self.checklist
                    .told
                    .batteries
                    .take_unnamed(m.battery_remaining);
                self.checklist.told.status = Some(m);
                self.check_batteries(out);
            }
            MavMessage::BATTERY_STATUS(m) => self.on_battery(&m, out),
            other => self.on_fence(&other, now, out),
        }
    }

    /// Whether the same text has just come over another link.
    fn is_repeated(&mut self, said: &str, now: SimTime) -> bool {
        if !self.paths.are_several() {
            return false;
        }
        let last = &mut self.last_texts;
        last.retain(|(_, at)| now.since_s(*at) < MODE_SETTLES_S);
        let repeated = last.iter().any(|(text, _)| text == said);
        if !repeated {
            last.push((said.to_owned(), now));
        }
        repeated
    }

    /// Reports a failsafe of which the vehicle had not told the cause, once it does, or after a while.
    pub(super) fn report_failsafe(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let Some(since) = self.cause_awaited else {
            return;
        };
        let failsafe = self.authority.shown().is_some_and(|shown| shown.failsafe);
        let cause = self.causes.at(now, failsafe);
        if cause.is_none() && now.since_s(since) < CAUSE_WITHIN_S {
            return;
        }
        self.cause_awaited = None;
        out.events.extend(self.authority.tell_cause(cause));
    }

    fn on_battery(&mut self, status: &BATTERY_STATUS_DATA, out: &mut BridgeOutput) {
        let battery = self.checklist.told.batteries.take(status);
        if let Some(battery) = battery.filter(|b| b.is_low() && !b.is_for_flight())
            && self.warned.other_batteries.insert(status.id)
        {
            let text = format!(
                "{battery} at {} %: the vehicle does not fly by it, and flies on",
                battery.left_pct
            );
            out.events
                .push(event(Severity::Warning, "other-battery-low", text));
        }
        self.check_batteries(out);
    }

    /// Warns of a low battery that the vehicle flies by, and brings it home.
    fn check_batteries(&mut self, out: &mut BridgeOutput) {
        let lowest = self.checklist.told.batteries.lowest_for_flight();
        let Some(battery) = lowest.filter(Battery::is_low) else {
            return;
        };
        if !std::mem::replace(&mut self.warned.battery, true) {
            let text = format!("{battery} at {} %", battery.left_pct);
            out.events
                .push(event(Severity::Warning, "battery-low", text));
        }
        let airborne = self.authority.shown().is_some_and(|s| s.airborne);
        if airborne && !self.control().has(Danger::Battery) {
            self.handle(ControlEvent::Begins(Danger::Battery), out);
        }
    }

    fn on_parameter(&mut self, parameter: &PARAM_VALUE_DATA, out: &mut BridgeOutput) {
        let name = text(&parameter.param_id[..]);
        let value = self.parameter_value(parameter);
        self.commands.parameter_seen(&name, value);
        match self.parameters.insert(name.clone(), value) {
            // Another link may bring it again.
            Some(old) if old == value => return,
            // Counters of the vehicle's own change all the time.
            Some(old) if self.checklist.parameters().contains(&name.as_str()) => {
                let text = format!("parameter {name} changed from {old} to {value}");
                out.events
                    .push(event(Severity::Info, "parameter-changed", text));
            }
            _ => {}
        }
        let known = &self.config.profile.parameters;
        if name == known.take_off_altitude && value.is_finite() && value > 0.0 {
            self.takeoff_altitude_m = Some(value);
        }
        // The checklist reports the same.
        if self.checklist.is_kept() {
            return;
        }
        let rule = known
            .rules
            .iter()
            .find(|r| r.link_failsafe && r.name == name);
        if let Some(Meaning::Doubtful(words)) = rule.map(|r| r.meaning(value)) {
            let text = format!("{name} is {value}: {words}");
            out.events
                .push(event(Severity::Warning, "failsafe-off", text));
        }
    }

    /// The number of a parameter, as its autopilot writes it.
    fn parameter_value(&self, parameter: &PARAM_VALUE_DATA) -> f64 {
        let whole = matches!(
            parameter.param_type,
            MavParamType::MAV_PARAM_TYPE_INT32 | MavParamType::MAV_PARAM_TYPE_UINT32
        );
        if whole && self.config.profile.commands.parameters_as_bytes {
            f64::from(parameter.param_value.to_bits().cast_signed())
        } else {
            f64::from(parameter.param_value)
        }
    }

    /// Reports missing heartbeats, frames or telemetry.
    pub(super) fn check_timeouts(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let statistics = self.paths.statistics();
        if statistics.frames == 0
            && statistics.bytes > NO_FRAMES_AFTER_BYTES
            && !std::mem::replace(&mut self.warned.no_frames, true)
        {
            let text = "bytes arrive, but no MAVLink 2 frame; check the baud rate and SERIALn_PROTOCOL = 2";
            out.events.push(event(Severity::Error, "no-mavlink2", text));
        }
        if self.heartbeat_at.is_none() || !self.authority.link_up() {
            return;
        }
        let silent_s = now.since_s(self.silent_since);
        if silent_s > self.config.link_timeout_s {
            self.commands.clear();
            self.placement.forget();
            self.authority.link_lost();
            self.on_phase(self.authority.phase());
            let text = format!(
                "no heartbeat for {silent_s:.1} s: the bridge withholds setpoints, and the vehicle relies on its \
                 own failsafe"
            );
            out.events.push(event(Severity::Warning, "link-lost", text));
            return;
        }
        if let Some(words) = self.gas.silence(self.connected_at, now) {
            out.events.push(event(Severity::Warning, "no-gas", words));
        }
        if now.since_s(self.connected_at) > TELEMETRY_WITHIN_S
            && self.telemetry.state(now).is_none()
            && !std::mem::replace(&mut self.warned.silent_telemetry, true)
        {
            let text = "the vehicle sends no usable GLOBAL_POSITION_INT, ATTITUDE and VFR_HUD; check that it has \
                        a position fix and accepts SET_MESSAGE_INTERVAL";
            out.events
                .push(event(Severity::Warning, "telemetry-missing", text));
        }
    }

    /// Reports losses of the link, at most once a minute.
    pub(super) fn report_link(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let (told_at, before) = self.told;
        if now.since_s(told_at) < LINK_REPORT_S {
            return;
        }
        let total = self.statistics();
        self.told = (now, total);
        if let Some(words) = total.since(&before) {
            let text = format!("in the last {LINK_REPORT_S:.0} s: {words}");
            out.events.push(event(Severity::Info, "link-losses", text));
        }
    }
}

fn severity(severity: MavSeverity) -> Severity {
    match severity as u8 {
        0..=3 => Severity::Error,
        4 => Severity::Warning,
        _ => Severity::Info,
    }
}
