//! The commands that the stand-in knows, and its answers to them as ArduPlane gives them: every
//! command is answered, those it does not know too.
#![allow(deprecated, reason = "ground stations still send the older forms")]

mod flying;

use super::StandIn;
use crate::flight::LAND;
use crate::streams::default_streams;
use mav_bridge::arduplane::{AUTO, GUIDED, LOITER, MANUAL, RTL};
use mav_bridge::dialect::{
    COMMAND_INT_DATA, COMMAND_LONG_DATA, MISSION_CURRENT_DATA, MavCmd, MavFrame, MavResult,
    MavSeverity,
};
use mav_bridge::wire::MessageData as _;
use protocol::SimTime;

use MavResult::{
    MAV_RESULT_ACCEPTED as ACCEPTED, MAV_RESULT_DENIED as DENIED, MAV_RESULT_FAILED as FAILED,
    MAV_RESULT_TEMPORARILY_REJECTED as NOT_NOW, MAV_RESULT_UNSUPPORTED as UNSUPPORTED,
};

/// Time after start-up before which it does not arm, s: its filter settles.
const READY_AFTER_S: f64 = 2.0;
/// ArduPlane's magic number (param2) that disarms even in flight.
const FORCE: f32 = 21196.0;

impl StandIn {
    /// Answers to a command by its number, which the dialect may not know.
    pub(crate) fn acknowledge(&mut self, command: u16, result: MavResult, now: SimTime) {
        self.speaker.acknowledge(command, result, now);
    }

    /// As ArduPlane answers a number that it does not know.
    pub(crate) fn reject_unknown_command(&mut self, command: u16, now: SimTime) {
        self.acknowledge(command, UNSUPPORTED, now);
    }

    /// The older form, with its place in floats.
    pub(crate) fn command_long(&mut self, m: &COMMAND_LONG_DATA, now: SimTime) {
        // A place in whole numbers is exact; one in floats is not.
        if m.command == MavCmd::MAV_CMD_DO_REPOSITION {
            return self.acknowledge(m.command as u16, UNSUPPORTED, now);
        }
        let (x, y, z, frame) = match m.command {
            MavCmd::MAV_CMD_DO_SET_HOME => {
                let whole = |deg: f32| (f64::from(deg) * 1e7).round() as i32;
                let frame = MavFrame::MAV_FRAME_GLOBAL;
                (whole(m.param5), whole(m.param6), m.param7, frame)
            }
            // A multicopter's, upwards from where it is.
            MavCmd::MAV_CMD_NAV_TAKEOFF => (0, 0, -m.param7, MavFrame::MAV_FRAME_LOCAL_OFFSET_NED),
            _ => {
                let frame = MavFrame::MAV_FRAME_GLOBAL_RELATIVE_ALT;
                (m.param5 as i32, m.param6 as i32, m.param7, frame)
            }
        };
        let whole = COMMAND_INT_DATA {
            param1: m.param1,
            param2: m.param2,
            param3: m.param3,
            param4: m.param4,
            x,
            y,
            z,
            command: m.command,
            target_system: m.target_system,
            target_component: m.target_component,
            frame,
            ..COMMAND_INT_DATA::default()
        };
        self.command_int(&whole, now);
    }

    pub(crate) fn command_int(&mut self, m: &COMMAND_INT_DATA, now: SimTime) {
        let result = self.obey(m, now);
        self.acknowledge(m.command as u16, result, now);
    }

    /// Commands that change how it flies, or what it is asked for.
    fn obey(&mut self, m: &COMMAND_INT_DATA, now: SimTime) -> MavResult {
        let (p1, p2) = (m.param1, m.param2);
        match m.command {
            MavCmd::MAV_CMD_DO_SET_MODE if p1 as u8 & 1 == 0 => DENIED,
            MavCmd::MAV_CMD_DO_SET_MODE => self.change_mode_to(p2 as u32),
            MavCmd::MAV_CMD_NAV_RETURN_TO_LAUNCH => self.change_mode(RTL),
            MavCmd::MAV_CMD_NAV_LAND if self.flight.hovers() => self.change_mode(LAND),
            MavCmd::MAV_CMD_NAV_TAKEOFF if self.flight.hovers() => self.lift_off(m.z.abs()),
            MavCmd::MAV_CMD_NAV_LOITER_UNLIM => self.change_mode(LOITER),
            MavCmd::MAV_CMD_MISSION_START if p1 != 0.0 || p2 != 0.0 => DENIED,
            MavCmd::MAV_CMD_MISSION_START => self.change_mode(AUTO),
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.arm(p1 == 1.0, p2, now),
            MavCmd::MAV_CMD_DO_REPOSITION => self.reposition(m),
            MavCmd::MAV_CMD_DO_CHANGE_ALTITUDE => self.change_altitude(p1, p2),
            MavCmd::MAV_CMD_DO_CHANGE_SPEED => self.change_speed(p1, p2, now),
            MavCmd::MAV_CMD_GUIDED_CHANGE_SPEED
            | MavCmd::MAV_CMD_GUIDED_CHANGE_ALTITUDE
            | MavCmd::MAV_CMD_GUIDED_CHANGE_HEADING => self.guide(m),
            MavCmd::MAV_CMD_DO_LAND_START => self.land_start(now),
            MavCmd::MAV_CMD_DO_SET_MISSION_CURRENT => self.set_mission_current(p1, p2),
            MavCmd::MAV_CMD_DO_SET_HOME => self.change_home(m, now),
            MavCmd::MAV_CMD_DO_FENCE_ENABLE => self.enable_fence(p1),
            // Neither a landing to be broken off nor a way back is ever marked; and a take-off
            // by command is a quadplane's.
            MavCmd::MAV_CMD_DO_GO_AROUND | MavCmd::MAV_CMD_DO_RETURN_PATH_START => FAILED,
            MavCmd::MAV_CMD_NAV_TAKEOFF => match m.frame {
                MavFrame::MAV_FRAME_LOCAL_OFFSET_NED => FAILED,
                _ => DENIED,
            },
            _ => self.answer(m, now),
        }
    }

    /// Commands that ask for something, or that concern the vehicle on the ground.
    fn answer(&mut self, m: &COMMAND_INT_DATA, now: SimTime) -> MavResult {
        if let Some(result) = self.speaker.obey(m, now) {
            return result;
        }
        match m.command {
            MavCmd::MAV_CMD_RUN_PREARM_CHECKS if self.flight.armed() => NOT_NOW,
            MavCmd::MAV_CMD_RUN_PREARM_CHECKS => ACCEPTED,
            MavCmd::MAV_CMD_PREFLIGHT_CALIBRATION => self.calibrate(m),
            MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN => self.reboot(m.param1),
            _ => UNSUPPORTED,
        }
    }

    /// Enters the mode that has a number on the wire.
    pub(crate) fn change_mode_to(&mut self, on_wire: u32) -> MavResult {
        let mode = self.firmware.inside(on_wire);
        mode.map_or(FAILED, |mode| self.change_mode(mode))
    }

    /// Takes off upwards, as a multirotor does in GUIDED once it is armed.
    fn lift_off(&mut self, above_home_m: f32) -> MavResult {
        let ready = self.flight.mode() == GUIDED && self.flight.armed() && !self.flight.flying();
        if !ready || !above_home_m.is_finite() || above_home_m <= 0.0 {
            return FAILED;
        }
        self.flight.lift_off(f64::from(above_home_m));
        ACCEPTED
    }

    pub(crate) fn change_mode(&mut self, mode: u32) -> MavResult {
        if self.flight.set_mode(mode, &self.speaker.parameters) {
            ACCEPTED
        } else {
            FAILED
        }
    }

    fn arm(&mut self, arm: bool, force: f32, now: SimTime) -> MavResult {
        let settles = now.s() < READY_AFTER_S;
        let unready =
            settles.then_some((MavSeverity::MAV_SEVERITY_CRITICAL, "Arm: AHRS not ready"));
        if let Some((severity, why)) = unready.or_else(|| self.mission_forbids_arming())
            && arm
            && force != FORCE
        {
            self.send_text(severity, why, now);
            return FAILED;
        }
        if !arm && self.flight.flying() && force != FORCE {
            return FAILED;
        }
        self.flight.set_armed(arm);
        let text = if arm {
            "Throttle armed"
        } else {
            "Throttle disarmed"
        };
        self.send_text(MavSeverity::MAV_SEVERITY_INFO, text, now);
        ACCEPTED
    }

    fn land_start(&mut self, now: SimTime) -> MavResult {
        let (text, result) = if self.begin_landing() {
            ("Landing sequence start", ACCEPTED)
        } else {
            ("Unable to start landing sequence", FAILED)
        };
        self.send_text(MavSeverity::MAV_SEVERITY_INFO, text, now);
        result
    }

    /// param2 = 1 forgets how often jumps have been made.
    fn set_mission_current(&mut self, item: f32, from_new: f32) -> MavResult {
        let whole = item.is_finite() && (0.0..=f32::from(u16::MAX)).contains(&item);
        if !whole {
            return DENIED;
        }
        if from_new == 1.0 && !self.go_on_with(0) {
            return FAILED;
        }
        if !self.go_on_with(item as u16) {
            return DENIED;
        }
        self.speaker.request_once(MISSION_CURRENT_DATA::ID, 0)
    }

    fn enable_fence(&mut self, action: f32) -> MavResult {
        let on = match action {
            0.0 => false,
            1.0 if !self.fence.is_empty() => true,
            _ => return FAILED,
        };
        let value = f32::from(u8::from(on));
        self.speaker
            .parameters
            .set(crate::parameters::FENCE_ENABLE, value);
        ACCEPTED
    }

    /// Gyroscopes and barometer, which have nothing to be found here; not while armed. The others
    /// need hands to turn the vehicle.
    fn calibrate(&mut self, m: &COMMAND_INT_DATA) -> MavResult {
        let asked = m.param1 == 1.0 || m.param3 == 1.0;
        if self.flight.armed() || !asked {
            return FAILED;
        }
        ACCEPTED
    }

    /// A new start, which keeps parameters and missions; not while armed.
    fn reboot(&mut self, what: f32) -> MavResult {
        if self.flight.armed() {
            return FAILED;
        }
        if what != 1.0 {
            return UNSUPPORTED;
        }
        self.speaker.restart(default_streams());
        self.gcs_heartbeat_at = None;
        self.change_mode(if self.flight.hovers() { LOITER } else { MANUAL })
    }
}
