//! What the stand-in tells: of its flight as it estimates it, and of its gas sensor.

use super::StandIn;
use crate::report::{Report, boot_ms};
use air::geo::Enu;
use mav_bridge::dialect::{MavSeverity, NAMED_VALUE_FLOAT_DATA, SCALED_PRESSURE_DATA};
use mav_bridge::wire::MessageData;
use protocol::SimTime;
use rand_distr::{Distribution, StandardNormal};

/// Noise of the barometer, hPa.
const PRESSURE_SD_HPA: f64 = 0.05;
/// Flight time of a full battery at cruise, s.
const BATTERY_S: f64 = 5400.0;

impl StandIn {
    pub(crate) fn send<D: MessageData>(&mut self, message: &D, now: SimTime) {
        self.speaker.send(message, now);
    }

    /// Says something to the people on the ground.
    pub(crate) fn send_text(&mut self, severity: MavSeverity, text: &str, now: SimTime) {
        self.speaker.send_text(severity, text, now);
    }

    /// Sends what is due.
    pub(crate) fn send_due(&mut self, now: SimTime) {
        let due = self.speaker.due(now);
        if due.is_empty() {
            return;
        }
        let report = self.report(now);
        for (message_id, which) in due {
            match message_id {
                NAMED_VALUE_FLOAT_DATA::ID => {
                    let gas = self.gas(now);
                    self.send(&gas, now);
                }
                SCALED_PRESSURE_DATA::ID => {
                    let white: f64 = StandardNormal.sample(&mut self.rng);
                    self.send(&report.pressure(PRESSURE_SD_HPA * white), now);
                }
                _ => self.speaker.tell(message_id, which, &report),
            }
        }
    }

    /// What it knows of itself.
    pub(crate) fn report(&self, now: SimTime) -> Report {
        let mission = self.flight.mission();
        Report {
            now,
            system_id: self.speaker.system_id,
            frame: self.reality.frame,
            mode: self.flight.mode(),
            firmware: self.firmware,
            armed: self.flight.armed(),
            flying: self.flight.flying(),
            landing: mission.is_landing(self.lists[0].items()),
            failsafe: self.failsafe,
            sensed: *self.flight.sensed(),
            state: self.flight.state(),
            reported: self.reported_position(now),
            here: self.flight.here(),
            home: self.flight.home(),
            origin: self.origin,
            wind_m_s: self.flight.wind_m_s(),
            eas_over_tas: self.reality.eas_over_tas(),
            air: self.reality.air(),
            sticks: self.flight.sticks(),
            guidance: self.flight.guidance(),
            charge: self.charge(),
            fence_present: !self.fence.is_empty(),
            fence_on: self.fence_is_on(),
            fence_breached: self.is_outside_fence(),
            fence_status: self.fence_status(),
            mission_current: self.mission_current(),
        }
    }

    /// The position that it reports: place and altitude above mean sea level, m.
    fn reported_position(&self, now: SimTime) -> (Enu, f64) {
        let sensed = self.flight.sensed();
        let ground_amsl_m = self.reality.model.spec().ground_amsl_m;
        let reported_position = plume::Place {
            east_m: sensed.east_m,
            north_m: sensed.north_m,
            height_agl_m: sensed.alt_amsl_m - ground_amsl_m,
        };
        let (logged, _) = self.reality.logged(&reported_position, now.s());
        let at = Enu::new(logged.east_m, logged.north_m);
        (at, ground_amsl_m + logged.height_agl_m)
    }

    fn gas(&mut self, now: SimTime) -> NAMED_VALUE_FLOAT_DATA {
        let dt_s = self.gas_sampled_at.map_or(0.0, |at| now.since_s(at));
        self.gas_sampled_at = Some(now);
        let state = self.flight.state();
        let ppm = self.reality.read_gas(&state, now.s(), dt_s, &mut self.rng);
        let (_, time_s) = self.reality.logged(&plume::Place::default(), now.s());
        NAMED_VALUE_FLOAT_DATA {
            time_boot_ms: boot_ms(time_s),
            value: ppm as f32,
            name: self.reality.gas().formula().into(),
        }
    }

    /// Voltage of the battery, mV, and what is left in it, per cent.
    fn charge(&self) -> (u16, i8) {
        let left = (1.0 - self.armed_s / BATTERY_S).clamp(0.0, 1.0);
        // Four lithium cells between 3.5 and 4.2 V.
        ((14_000.0 + 2_800.0 * left) as u16, (100.0 * left) as i8)
    }
}
