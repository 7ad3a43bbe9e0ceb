//! Commands to the vehicle.

use super::placement::Astray;
use super::{Bridge, BridgeOutput};
use crate::authority::BridgePhase;
use crate::command_queue::{CommandMessage, CommandOutcome, VehicleCommand};
use crate::dialect::POSITION_TARGET_GLOBAL_INT_DATA;
use crate::event::event;
use air::geo::Geodetic;
use protocol::SimTime;
use protocol::message::{PathKind, Setpoint, Severity};

/// Share of the altitude of its take-off above which that climb is done.
const CLIMBED: f64 = 0.8;
/// Lowest altitude above home to which a multirotor takes off, m.
const LEAST_CLIMB_M: f64 = 5.0;
/// Pause after a refusal or no answer, ns.
const PAUSE_NS: i64 = 5_000_000_000;

impl Bridge {
    /// Asks for the mode that takes off; arming follows when the vehicle shows the mode.
    pub(super) fn take_off(&mut self, setpoint: &Setpoint, now: SimTime, out: &mut BridgeOutput) {
        if self.target.as_ref() == Some(setpoint) {
            return; // refused before: tried again after a pause
        }
        self.clear_target();
        self.target = Some(setpoint.clone());
        if let Some(words) = self.checklist.refusals(&self.parameters) {
            // Looked at again after a pause.
            self.retry_at = pause(now);
            if !std::mem::replace(&mut self.warned.take_off_refused, true) {
                let text = format!("no take-off: {words}");
                out.events
                    .push(event(Severity::Error, "take-off-refused", text));
            }
            return;
        }
        self.warned.take_off_refused = false;
        let profile = self.config.profile;
        if profile.commands.take_off_by_command {
            let height_m = self
                .telemetry
                .home_amsl_m()
                .map(|m| setpoint.alt_amsl_m - m);
            self.takeoff_altitude_m = height_m
                .filter(|m| *m > LEAST_CLIMB_M)
                .or(Some(LEAST_CLIMB_M));
            self.authority.climb(profile.modes.take_off);
        } else {
            self.authority.take_off(profile.modes.take_off);
        }
        self.send_mode();
        let text = "take-off requested";
        out.events.push(event(Severity::Info, "take-off", text));
    }

    /// Asks for the landing sequence on board, or for the way home where that ends with a landing.
    pub(super) fn land(&mut self, setpoint: &Setpoint) {
        // A reposition still on its way would pull the vehicle out of its landing.
        self.commands.drop_steering();
        self.target = Some(setpoint.clone());
        let modes = &self.config.profile.modes;
        match modes.landing {
            Some(mode) => {
                self.authority.land(mode);
                self.commands.push(VehicleCommand::LandStart);
            }
            None => {
                self.authority.land(modes.home);
                self.send_mode();
            }
        }
    }

    /// Brings it home to land without a setpoint.
    pub(super) fn come_down(&mut self) {
        let home = Setpoint {
            path: PathKind::Land,
            ..self.target.clone().unwrap_or(Setpoint {
                path: PathKind::Land,
                lat_deg: 0.0,
                lon_deg: 0.0,
                alt_amsl_m: 0.0,
                airspeed_m_s: 0.0,
                orbit_radius_m: 0.0,
            })
        };
        // The vehicle itself chooses where it lands.
        self.land(&home);
    }

    /// Sends where to fly and how fast.
    pub(super) fn guide(&mut self, setpoint: &Setpoint, now: SimTime) {
        if self.target.as_ref() == Some(setpoint) {
            return;
        }
        self.ignored = None;
        self.target = Some(setpoint.clone());
        self.send_target(now);
    }

    fn send_target(&mut self, now: SimTime) {
        self.retry_at = None;
        self.placement.forget();
        let Some(target) = self.target.clone() else {
            return;
        };
        if target.path == PathKind::Land {
            return self.land(&target);
        }
        let modes = &self.config.profile.modes;
        if self.config.attitude_targets && modes.attitudes != modes.places {
            return; // places do not count in that mode
        }
        // Under attitude control a place is the fallback if attitudes stop.
        // Autopilots fly equivalent airspeed, the team true airspeed.
        let ratio = if self.config.profile.commands.ground_speed {
            1.0
        } else {
            self.telemetry.eas_over_tas(target.alt_amsl_m, now)
        };
        let speed = (target.airspeed_m_s * ratio) as f32;
        let with_place = self.config.profile.commands.speed_with_place;
        self.commands.push(VehicleCommand::Reposition {
            lat_1e7: (target.lat_deg * 1e7).round() as i32,
            lon_1e7: (target.lon_deg * 1e7).round() as i32,
            alt_amsl_m: target.alt_amsl_m as f32,
            radius_m: target.orbit_radius_m as f32,
            equivalent_airspeed_m_s: with_place.then_some(speed),
        });
        if with_place {
            return;
        }
        // A multirotor stops at its places, so its speed does not show whether another station has changed the setting.
        if self.config.profile.commands.ground_speed {
            self.speed.forget();
        }
        if self.speed.sends(speed, now) {
            self.commands.push(VehicleCommand::Speed {
                equivalent_airspeed_m_s: speed,
            });
        }
    }

    /// Sends the mode that was asked for, if the vehicle is not in it already.
    fn send_mode(&mut self) {
        if let Some(mode) = self.authority.unconfirmed() {
            let attempts = self.config.attempts;
            self.commands.push(VehicleCommand::Mode { mode, attempts });
        }
    }

    /// What follows by itself: arming, the mode for setpoints after the climb, a target to be sent again.
    pub(super) fn continue_phase(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let Some(seen) = self.authority.shown().filter(|_| self.authority.link_up()) else {
            return;
        };
        let pausing = self.retry_at.is_some_and(|at| now < at);
        let modes = &self.config.profile.modes;
        let climbs = seen.custom_mode == modes.take_off;
        match self.authority.phase() {
            BridgePhase::Ground if self.retry_at.is_some() && !pausing => {
                self.retry_at = None;
                if let Some(target) = self.target.take() {
                    self.take_off(&target, now, out);
                }
            }
            BridgePhase::TakeOff if climbs && !seen.armed && !pausing => {
                self.arm(now, out);
            }
            BridgePhase::TakeOff
                if climbs
                    && self.config.profile.commands.take_off_by_command
                    && !seen.airborne
                    && !pausing =>
            {
                self.retry_at = pause(now);
                let above_home_m = self.takeoff_altitude_m.unwrap_or(LEAST_CLIMB_M) as f32;
                self.commands.push(VehicleCommand::TakeOff { above_home_m });
            }
            BridgePhase::TakeOff
                if (climbs || modes.after_take_off == Some(seen.custom_mode))
                    && seen.airborne
                    && !pausing
                    && self.authority.unconfirmed().is_none()
                    && self.has_climbed()
                    && self.attitudes_are_there(now) =>
            {
                self.retry_at = None;
                self.authority.take_off(self.authority.guided_mode());
                self.send_mode();
            }
            BridgePhase::Guided if self.retry_at.is_some() && !pausing => self.send_target(now),
            BridgePhase::HandingBack if self.mode_waits && self.attitudes_are_there(now) => {
                self.mode_waits = false;
                // Once only: a repetition could cross the pilot's next change of mind.
                let mode = self.authority.guided_mode();
                self.commands
                    .push(VehicleCommand::Mode { mode, attempts: 1 });
            }
            // On its way home already, or still climbing away from the ground, it is left alone.
            BridgePhase::Guardian
                if seen.airborne
                    && !modes.is_homeward(seen.custom_mode)
                    && (!climbs || self.has_climbed())
                    && !pausing
                    && self.authority.unconfirmed() != Some(modes.home) =>
            {
                self.retry_at = None;
                self.authority.go_home();
                self.send_mode();
            }
            _ => {}
        }
    }

    fn arm(&mut self, now: SimTime, out: &mut BridgeOutput) {
        if self.config.may_arm {
            self.retry_at = pause(now);
            self.commands.push(VehicleCommand::Arm);
        } else if !std::mem::replace(&mut self.warned.waits_for_arming, true) {
            let modes = &self.config.profile.modes;
            let mode = modes.short_name(modes.take_off);
            let text = format!("in {mode}: waiting for a person to arm the motor");
            out.events
                .push(event(Severity::Info, "waits-for-arming", text));
        }
    }

    pub(super) fn has_climbed(&self) -> bool {
        let enough_m = self
            .takeoff_altitude_m
            .map_or(self.config.guided_above_home_m, |alt| CLIMBED * alt);
        self.telemetry.above_home_m().is_some_and(|h| h >= enough_m)
    }

    /// Processes the outcome of a command.
    pub(super) fn on_outcome(
        &mut self,
        outcome: CommandOutcome,
        now: SimTime,
        out: &mut BridgeOutput,
    ) {
        // A parameter that it does not have stands in the checklist as not told.
        if let CommandOutcome::Unanswered(VehicleCommand::Parameter(_)) = &outcome
            && self.checklist.is_kept()
        {
            return;
        }
        let (command, why) = match outcome {
            CommandOutcome::Accepted(VehicleCommand::Reposition {
                lat_1e7, lon_1e7, ..
            }) if self.authority.phase() == BridgePhase::Guided => {
                return self.placement.taken(lat_1e7, lon_1e7, now);
            }
            CommandOutcome::Accepted(_) => return,
            CommandOutcome::Refused(command, result) => {
                (command, format!("the vehicle rejects it: {result:?}"))
            }
            CommandOutcome::Unanswered(command) => {
                let why = if self.warned.unsigned {
                    "the vehicle signs its frames and does not answer unsigned ones"
                } else {
                    "the vehicle does not answer"
                };
                (command, why.to_owned())
            }
        };
        let (severity, code, then) = self.on_failure(&command, now);
        let text = format!("{}: {why}{then}", command.name(self.config.profile));
        out.events.push(event(severity, code, text));
    }

    fn on_failure(
        &mut self,
        command: &VehicleCommand,
        now: SimTime,
    ) -> (Severity, &'static str, &'static str) {
        if command.steers() {
            self.retry_at = pause(now);
        }
        match command {
            VehicleCommand::Mode { .. } => {
                let asked = self.authority.unconfirmed();
                let phase = self.authority.phase();
                self.authority.refused();
                match phase {
                    BridgePhase::TakeOff if asked == Some(self.authority.guided_mode()) => {
                        (Severity::Error, "guided-failed", "; the bridge tries again")
                    }
                    BridgePhase::TakeOff => (
                        Severity::Error,
                        "take-off-failed",
                        "; the bridge tries again",
                    ),
                    BridgePhase::HandingBack => {
                        let then = "; control is unchanged";
                        (Severity::Error, "hand-back-failed", then)
                    }
                    BridgePhase::Landing => {
                        (Severity::Error, "land-failed", "; the bridge tries again")
                    }
                    BridgePhase::Guardian => {
                        (Severity::Error, "home-failed", "; the bridge tries again")
                    }
                    _ => (Severity::Warning, "command-failed", ""),
                }
            }
            VehicleCommand::LandStart => {
                self.authority.land(self.config.profile.modes.home);
                self.send_mode();
                let then = "; it returns home and circles until a pilot lands it";
                (Severity::Warning, "no-landing-sequence", then)
            }
            VehicleCommand::Arm => {
                let again = "; the bridge tries again";
                let then = self.checklist.told.cure().unwrap_or(again);
                (Severity::Error, "arming-failed", then)
            }
            VehicleCommand::TakeOff { .. } => (
                Severity::Error,
                "take-off-failed",
                "; the bridge tries again",
            ),
            VehicleCommand::Reposition { .. } => (
                Severity::Warning,
                "setpoint-failed",
                "; the bridge tries again",
            ),
            VehicleCommand::Speed { .. } => {
                // The next setpoint requests it again; now it would be rejected again.
                self.retry_at = None;
                self.speed.forget();
                (Severity::Warning, "speed-failed", "")
            }
            VehicleCommand::Interval { .. } => (Severity::Info, "rate-failed", ""),
            VehicleCommand::SetParameter { .. } => (Severity::Warning, "parameter-failed", ""),
            VehicleCommand::Parameter(name) => {
                let rules = self.config.profile.parameters.rules;
                let then = if rules.iter().any(|r| r.link_failsafe && r.name == *name) {
                    "; it is unknown whether the vehicle returns home when the link is lost"
                } else {
                    ""
                };
                (Severity::Warning, "parameter-failed", then)
            }
        }
    }

    /// Sends what is due.
    pub(super) fn send_commands(&mut self, now: SimTime, out: &mut BridgeOutput) {
        let Some(to) = self.identity.address().filter(|_| self.authority.link_up()) else {
            return;
        };
        let (send, lost) = self.commands.due(
            now,
            self.config.ack_timeout_s,
            self.config.attempts,
            self.heartbeat_at,
        );
        for (command, sent) in send {
            self.send_command(&command, sent, to, now, out);
        }
        for outcome in lost {
            self.on_outcome(outcome, now, out);
        }
    }

    pub(super) fn send_command(
        &mut self,
        command: &VehicleCommand,
        sent: u32,
        to: (u8, u8),
        now: SimTime,
        out: &mut BridgeOutput,
    ) {
        let message = command.message(to, sent, self.config.profile);
        // Requests for values and for message rates do not change the flight. Without the rates, a vehicle whose streams
        // are off sends no telemetry.
        let asks = matches!(command, VehicleCommand::Interval { .. })
            || matches!(message, CommandMessage::Read(_));
        if self.config.dry_run && !asks {
            self.commands.forget(command);
            let name = command.name(self.config.profile);
            return match message {
                CommandMessage::Long(message) => self.show(&name, &message, now, out),
                CommandMessage::Int(message) => self.show(&name, &message, now, out),
                CommandMessage::Read(message) => self.show(&name, &message, now, out),
                CommandMessage::Set(message) => self.show(&name, &message, now, out),
            };
        }
        match message {
            CommandMessage::Long(message) => self.send(&message, now, out),
            CommandMessage::Int(message) => self.send(&message, now, out),
            CommandMessage::Read(message) => self.send(&message, now, out),
            CommandMessage::Set(message) => self.send(&message, now, out),
        }
    }

    /// Receives the vehicle's reported target. If it differs from the commanded one, another sender has control from now
    /// on: two alternating targets would lead nowhere, and the later one has a reason.
    pub(super) fn on_target(
        &mut self,
        target: &POSITION_TARGET_GLOBAL_INT_DATA,
        now: SimTime,
        out: &mut BridgeOutput,
    ) {
        let guided = self.authority.phase() == BridgePhase::Guided && !self.commands.repositions();
        let astray = self.placement.target(target, now).filter(|_| guided);
        let Some(Astray::To(at)) = astray else { return };
        self.authority.taken_by_station();
        self.on_phase(BridgePhase::Pilot);
        let text = format!(
            "another ground station sent the vehicle to {:.5}, {:.5} and now controls it; the bridge withholds \
             setpoints until a hand-back",
            at.lat_deg, at.lon_deg
        );
        out.events
            .push(event(Severity::Warning, "other-ground-station", text));
    }

    /// Looks whether the vehicle flies to where it was sent; one that does not is sent again.
    pub(super) fn check_placement(&mut self, now: SimTime, out: &mut BridgeOutput) {
        if self.authority.phase() != BridgePhase::Guided {
            return self.placement.forget();
        }
        let Some((_, position)) = &self.telemetry.position else {
            return;
        };
        let here = Geodetic::new(f64::from(position.lat) / 1e7, f64::from(position.lon) / 1e7);
        if self.placement.look(here, now) == Some(Astray::Away) {
            let text = "the vehicle flies away from its setpoint; the bridge sends it again. Another ground \
                        station may have sent the vehicle elsewhere, or the wind may be as fast as its airspeed";
            out.events
                .push(event(Severity::Warning, "off-course", text));
            self.retry_at = Some(now);
        }
    }
}

fn pause(now: SimTime) -> Option<SimTime> {
    Some(SimTime::from_ns(now.ns().saturating_add(PAUSE_NS)))
}
