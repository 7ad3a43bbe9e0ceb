//! What comes from the vehicle.

use super::{Bridge, BridgeOutput};
use crate::arduplane::{FS_GCS_ENABL, FS_LONG_ACTN, TKOFF_ALT, mode_name};
use crate::authority::{BridgePhase, HeartbeatState};
use crate::command_queue::VehicleCommand;
use crate::dialect::{
    ATTITUDE_DATA, EXTENDED_SYS_STATE_DATA, GLOBAL_POSITION_INT_DATA, HEARTBEAT_DATA,
    HYGROMETER_SENSOR_DATA, MavAutopilot, MavMessage, MavSeverity, MavState, MavType,
    NAMED_VALUE_FLOAT_DATA, PARAM_VALUE_DATA, SCALED_PRESSURE_DATA, SYS_STATUS_DATA, VFR_HUD_DATA,
    WIND_DATA,
};
use crate::event::event;
use crate::wire::RawFrame;
use mavlink::MessageData;
use plume::{Gas, Unit};
use protocol::SimTime;
use protocol::control_level::{ControlEvent, Danger};
use protocol::message::Severity;

/// After a gas' formula where its reading is in ppb.
const IN_PPB: &str = "_PPB";
/// Bytes that must have come in without a frame before the team is warned.
const NO_FRAMES_AFTER_BYTES: u64 = 2000;
/// Telemetry asked for must have come after this long, s.
const TELEMETRY_WITHIN_S: f64 = 10.0;
/// Battery level at which the team is warned, per cent.
const BATTERY_LOW_PCT: i8 = 20;
/// Component id of an autopilot.
const AUTOPILOT: u8 = 1;
/// Rate of what changes slowly, 1/s.
const SLOW_HZ: f64 = 2.0;

impl Bridge {
    /// Takes all whole frames out of the decoder.
    pub(super) fn process_frames(&mut self, now: SimTime, out: &mut BridgeOutput) {
        while let Some(frame) = self.decoder.next_frame(now) {
            self.process_frame(&frame, now, out);
            out.frames_from_vehicle.push(frame.into_bytes());
        }
    }

    fn process_frame(&mut self, frame: &RawFrame, now: SimTime, out: &mut BridgeOutput) {
        if let Some(signing) = &mut self.signing
            && !signing.accepts(frame, now)
        {
            self.lost.refused_frames += 1;
            if !std::mem::replace(&mut self.warned.signature, true) {
                let text = "frames without a valid signature are refused: \
                            does the vehicle share the key?";
                out.events
                    .push(event(Severity::Error, "signature-refused", text));
            }
            return;
        }
        let Some(message) = frame.message() else {
            self.lost.unreadable_frames += 1;
            return;
        };
        let from_autopilot = frame.component_id() == AUTOPILOT;
        if let MavMessage::HEARTBEAT(heartbeat) = &message {
            let candidate = heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID
                && heartbeat.mavtype != MavType::MAV_TYPE_GCS;
            if from_autopilot && candidate && self.vehicle.is_none() {
                self.vehicle = Some(frame.system_id());
            }
        }
        if self.vehicle != Some(frame.system_id()) {
            return;
        }
        if from_autopilot {
            self.count_lost(frame.sequence());
        }
        match message {
            MavMessage::HEARTBEAT(heartbeat) if from_autopilot => {
                self.on_heartbeat(heartbeat, now, out);
            }
            // A gas sensor may be a component of its own.
            other => self.on_message(other, now, out),
        }
    }

    fn count_lost(&mut self, sequence: u8) {
        if let Some(last) = self.last_sequence.replace(sequence) {
            let gap = sequence.wrapping_sub(last).wrapping_sub(1);
            // A gap of more than half the range is a restart or a frame that came late.
            if gap < 128 {
                self.lost.lost_frames += u64::from(gap);
            }
        }
    }

    fn on_heartbeat(&mut self, heartbeat: HEARTBEAT_DATA, now: SimTime, out: &mut BridgeOutput) {
        let first = self.heartbeat_at.is_none();
        let restored = !first && !self.authority.link_up();
        self.heartbeat_at = Some(now);
        let failsafe = matches!(
            heartbeat.system_status,
            MavState::MAV_STATE_CRITICAL | MavState::MAV_STATE_EMERGENCY
        );
        let custom_mode = heartbeat.custom_mode;
        if first {
            self.identify(&heartbeat, out);
        }
        self.telemetry.heartbeat = Some((now, heartbeat));
        if restored {
            let text = format!("heartbeat heard again, in {}", mode_name(custom_mode));
            out.events
                .push(event(Severity::Info, "link-restored", text));
        }
        self.commands.mode_seen(custom_mode);
        let before = self.authority.phase();
        let change = self.authority.observe(HeartbeatState {
            custom_mode,
            armed: self.telemetry.armed(),
            airborne: self.telemetry.airborne(now),
            failsafe,
        });
        out.events.extend(change);
        let phase = self.authority.phase();
        if phase != before {
            self.on_phase(phase);
        }
        if first || restored {
            self.connected_at = now;
            self.request_telemetry();
            if phase == BridgePhase::Guided {
                self.retry_at = Some(now);
            }
        }
    }

    pub(super) fn on_phase(&mut self, phase: BridgePhase) {
        match phase {
            BridgePhase::Pilot | BridgePhase::Guardian | BridgePhase::Ground => {
                self.commands.drop_steering();
                self.clear_target();
            }
            BridgePhase::Guided => {
                // ArduPlane forgets a commanded speed at each change of mode.
                self.speed_sent = None;
                self.retry_at = self.heartbeat_at;
            }
            _ => {}
        }
    }

    fn identify(&mut self, heartbeat: &HEARTBEAT_DATA, out: &mut BridgeOutput) {
        let system = self.vehicle.unwrap_or_default();
        let plane = heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA
            && matches!(
                heartbeat.mavtype,
                MavType::MAV_TYPE_FIXED_WING | MavType::MAV_TYPE_GENERIC
            );
        if plane {
            let text = format!("ArduPlane heard as system {system}");
            return out.events.push(event(Severity::Info, "connected", text));
        }
        self.authority.unsupported();
        let what = if heartbeat.autopilot == MavAutopilot::MAV_AUTOPILOT_PX4 {
            "PX4".to_owned()
        } else {
            format!("{:?}, {:?}", heartbeat.autopilot, heartbeat.mavtype)
        };
        let text = format!(
            "system {system} is no ArduPlane ({what}): its telemetry is passed on, but it is never \
             commanded, for its flight modes have other numbers"
        );
        out.events
            .push(event(Severity::Error, "not-an-arduplane", text));
    }

    fn request_telemetry(&mut self) {
        let fast = self.config.telemetry_hz;
        for (message_id, hz) in [
            (GLOBAL_POSITION_INT_DATA::ID, fast),
            (ATTITUDE_DATA::ID, fast),
            (VFR_HUD_DATA::ID, fast),
            (WIND_DATA::ID, SLOW_HZ),
            (SCALED_PRESSURE_DATA::ID, SLOW_HZ),
            (HYGROMETER_SENSOR_DATA::ID, SLOW_HZ),
            (EXTENDED_SYS_STATE_DATA::ID, SLOW_HZ),
            (SYS_STATUS_DATA::ID, 1.0),
        ] {
            self.commands
                .push(VehicleCommand::Interval { message_id, hz });
        }
        for name in [FS_GCS_ENABL, FS_LONG_ACTN, TKOFF_ALT] {
            self.commands.push(VehicleCommand::Parameter(name));
        }
    }

    fn on_message(&mut self, message: MavMessage, now: SimTime, out: &mut BridgeOutput) {
        let received = &mut self.telemetry;
        match message {
            MavMessage::GLOBAL_POSITION_INT(m) => {
                received.position = Some((now, m));
                out.state = self.telemetry.state(now).or(out.state.take());
            }
            MavMessage::ATTITUDE(m) => received.attitude = Some((now, m)),
            MavMessage::VFR_HUD(m) => received.hud = Some((now, m)),
            MavMessage::WIND(m) => received.wind = Some((now, m)),
            MavMessage::SCALED_PRESSURE(m) => received.pressure = Some((now, m)),
            MavMessage::HYGROMETER_SENSOR(m) => received.hygrometer = Some((now, m)),
            MavMessage::EXTENDED_SYS_STATE(m) => received.landed = Some((now, m)),
            MavMessage::NAMED_VALUE_FLOAT(m) => {
                if let Some(ppm) = self.ppm(&m) {
                    let taken = self.telemetry.reading(ppm, m.time_boot_ms, now);
                    out.reading = taken.or(out.reading.take());
                }
            }
            MavMessage::COMMAND_ACK(m) => {
                if let Some(outcome) = self.commands.acknowledge(m.command, m.result, now) {
                    self.on_outcome(outcome, now, out);
                }
            }
            MavMessage::PARAM_VALUE(m) => self.on_parameter(&m, out),
            MavMessage::STATUSTEXT(m) => {
                let severity = severity(m.severity);
                let warned = text(&m.text[..]);
                out.events.push(event(severity, "vehicle-says", warned));
            }
            MavMessage::SYS_STATUS(m) => self.on_battery(m.battery_remaining, out),
            MavMessage::BATTERY_STATUS(m) => self.on_battery(m.battery_remaining, out),
            _ => {}
        }
    }

    /// Takes in what is left in a battery, per cent; −1 if the vehicle does not know.
    fn on_battery(&mut self, left_pct: i8, out: &mut BridgeOutput) {
        if !(0..=BATTERY_LOW_PCT).contains(&left_pct) {
            return;
        }
        if !std::mem::replace(&mut self.warned.battery, true) {
            let text = format!("battery at {left_pct} %");
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
        let value = f64::from(parameter.param_value);
        self.commands.parameter_seen(&name);
        let warning = match name.as_str() {
            FS_GCS_ENABL if value == 0.0 => {
                "FS_GCS_ENABL is 0: on loss of this link the vehicle flies on; set it to 1"
            }
            FS_LONG_ACTN if value == 0.0 => {
                "FS_LONG_ACTN is 0: on loss of this link in GUIDED the vehicle flies on; \
                 set it to 1 to bring it home"
            }
            TKOFF_ALT if value.is_finite() && value > 0.0 => {
                self.takeoff_altitude_m = Some(value);
                return;
            }
            _ => return,
        };
        out.events
            .push(event(Severity::Warning, "failsafe-off", warning));
    }

    /// Says what is missing: heartbeat, frames among the bytes, telemetry.
    pub(super) fn check_timeouts(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let statistics = self.decoder.statistics();
        if statistics.frames == 0
            && statistics.bytes > NO_FRAMES_AFTER_BYTES
            && !std::mem::replace(&mut self.warned.no_frames, true)
        {
            let text = "bytes come in, but no MAVLink 2 frame: check baud rate and \
                        SERIALn_PROTOCOL = 2";
            out.events.push(event(Severity::Error, "no-mavlink2", text));
        }
        let Some(heartbeat_at) = self.heartbeat_at.filter(|_| self.authority.link_up()) else {
            return;
        };
        let silent_s = now.since_s(heartbeat_at);
        if silent_s > self.config.link_timeout_s {
            self.commands.clear();
            self.authority.link_lost();
            self.on_phase(self.authority.phase());
            let text = format!(
                "no heartbeat for {silent_s:.1} s: setpoints are withheld, the vehicle relies on \
                 its own failsafe"
            );
            out.events.push(event(Severity::Warning, "link-lost", text));
        } else if now.since_s(self.connected_at) > TELEMETRY_WITHIN_S
            && self.telemetry.state(now).is_none()
            && !std::mem::replace(&mut self.warned.silent_telemetry, true)
        {
            let text = "the vehicle sends no usable GLOBAL_POSITION_INT, ATTITUDE and VFR_HUD: \
                        has it a position fix, and does it grant SET_MESSAGE_INTERVAL?";
            out.events
                .push(event(Severity::Warning, "telemetry-missing", text));
        }
    }
}

/// The text of a field up to its first zero.
impl Bridge {
    /// The reading of the gas that counts, ppm; none of another value, or of what cannot be read.
    fn ppm(&self, named: &NAMED_VALUE_FLOAT_DATA) -> Option<f64> {
        let name = text(&named.name[..]);
        let unit = match name.strip_prefix(self.config.gas.formula())? {
            "" => Unit::Ppm,
            IN_PPB => Unit::Ppb,
            _ => return None,
        };
        let ppm = unit.to_ppm(f64::from(named.value));
        // Air holds so much CO2 that no noise takes a reading below zero; of other gases it may.
        let least_ppm = if self.config.gas == Gas::Co2 {
            0.0
        } else {
            -1.0
        };
        (least_ppm..=1e6).contains(&ppm).then_some(ppm)
    }
}

fn text(bytes: &[u8]) -> String {
    let end = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    String::from_utf8_lossy(&bytes[..end]).into_owned()
}

fn severity(severity: MavSeverity) -> Severity {
    match severity as u8 {
        0..=3 => Severity::Error,
        4 => Severity::Warning,
        _ => Severity::Info,
    }
}
