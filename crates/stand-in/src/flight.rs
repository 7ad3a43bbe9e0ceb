//! The stand-in's flight: modes as ArduPlane has them, flown by Plumage's flight dynamics.

use crate::estimator::Estimator;
use crate::home_position::HomePosition;
use crate::item_list::{Item, ItemList};
use crate::mission_run::{MissionEvent, MissionRun, Place, Surroundings};
use crate::parameters::{
    AIRSPEED_MAX, AIRSPEED_MIN, AutopilotParameters, MIN_GROUNDSPEED, WP_LOITER_RAD,
};
use crate::reality::Reality;
use air::geo::Enu;
use fdm::autopilot::{Demand, HeldAttitude, Path, Sensed, Sticks};
use fdm::{AirAround, Airframe, FdmError, FlightPhase, FlightState, PilotedFlight};
use mav_bridge::arduplane::{AUTO, CIRCLE, FBWA, GUIDED, LOITER, MANUAL, RTL, TAKEOFF, TKOFF_ALT};
use rand::rngs::ChaCha8Rng;

/// Period of what changes slowly: mean wind, air, errors of the estimate, s.
const SLOW_S: f64 = 0.1;
/// Longest step of the autopilot, s.
const LOOP_S: f64 = 0.02;
/// Longest time flown in one call, s: after a longer pause the rest is left out.
const LONGEST_PAUSE_S: f64 = 10.0;
/// Height below TKOFF_ALT at which the climb of mode TAKEOFF is done, m.
const CLIMB_DONE_M: f64 = 5.0;

/// How long an attitude or a throttle that a ground station sends in GUIDED counts, s (ArduPlane, `mode_guided.cpp`).
const HELD_S: f64 = 3.0;

/// Distance from the point of return within which a multirotor goes down, m.
const ABOVE_HOME_M: f64 = 2.0;
/// The mode LAND, which ArduPlane does not have.
pub(crate) const LAND: u32 = u32::MAX;

/// Farthest rally point that it returns to, m.
const RALLY_WITHIN_M: f64 = 5000.0;

/// What the ground has told it to fly by.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Orders<'a> {
    pub parameters: &'a AutopilotParameters,
    pub mission: &'a [Item],
    pub rally: &'a [Item],
}

impl<'a> Orders<'a> {
    pub(crate) fn new(parameters: &'a AutopilotParameters, lists: &'a [ItemList; 3]) -> Self {
        Self {
            parameters,
            mission: lists[0].items(),
            rally: lists[2].items(),
        }
    }
}

/// What guides it now.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Guidance {
    /// Bank and pitch asked for, rad.
    pub bank_rad: f64,
    pub pitch_rad: f64,
    /// Where it flies to, or around; none by hand and in TAKEOFF.
    pub target: Option<Place>,
    /// Distance from the line that it follows, m.
    pub across_m: f64,
    /// True airspeed asked for, m/s.
    pub airspeed_m_s: f64,
}

/// The vehicle in flight.
#[derive(Debug, Clone)]
pub(crate) struct FlightController {
    craft: PilotedFlight,
    estimator: Estimator,
    sensed: Sensed,
    home: HomePosition,
    mission: MissionRun,
    /// What its mission has to say to the ground.
    events: Vec<MissionEvent>,
    slow_s: f64,
    mode: u32,
    armed: bool,
    sticks: Sticks,
    /// Where GUIDED, LOITER and CIRCLE fly.
    target: Demand,
    /// True airspeed commanded, m/s.
    airspeed_m_s: f64,
    cruise_m_s: f64,
    climbing: bool,
    /// Where RTL leads.
    return_to: Option<Place>,
    /// Height above mean sea level to which a multirotor takes off in GUIDED, m.
    lifting_to_m: Option<f64>,
    /// A multirotor that returns is above home and goes down.
    descends: bool,
    /// Bank and pitch (rad) and throttle that a ground station holds in GUIDED, with the time at which each came, s.
    held: [Option<(f64, f64)>; 3],
}

impl FlightController {
    pub(crate) fn new(
        aircraft: &Airframe,
        home: HomePosition,
        rng: &mut ChaCha8Rng,
    ) -> Result<Self, FdmError> {
        let craft = PilotedFlight::on_ground(
            aircraft,
            home.at.north_m,
            home.at.east_m,
            home.ground_amsl_m,
            home.heading_deg,
        )?;
        let cruise_m_s = aircraft.speeds().cruise_m_s;
        let estimator = Estimator::new(aircraft.navigation(), rng);
        let sensed = estimator.sensed(&craft.state(), 1.2);
        Ok(Self {
            estimator,
            sensed,
            home,
            mission: MissionRun::new(),
            events: Vec::new(),
            slow_s: SLOW_S,
            mode: if aircraft.hovers() { LOITER } else { MANUAL },
            armed: false,
            sticks: CENTRED,
            target: Demand {
                path: Path::Heading {
                    deg: home.heading_deg,
                },
                alt_amsl_m: home.ground_amsl_m,
                airspeed_m_s: cruise_m_s,
            },
            airspeed_m_s: cruise_m_s,
            cruise_m_s,
            climbing: false,
            return_to: None,
            lifting_to_m: None,
            descends: false,
            held: [None; 3],
            craft,
        })
    }

    pub(crate) fn state(&self) -> FlightState {
        self.craft.state()
    }

    /// The state as its autopilot estimates it.
    pub(crate) fn sensed(&self) -> &Sensed {
        &self.sensed
    }

    /// The wind as its autopilot estimates it, north and east, towards, m/s.
    pub(crate) fn wind_m_s(&self) -> Option<[f64; 2]> {
        self.estimator.wind_m_s()
    }

    pub(crate) fn mode(&self) -> u32 {
        self.mode
    }

    pub(crate) fn armed(&self) -> bool {
        self.armed
    }

    pub(crate) fn flying(&self) -> bool {
        self.state().phase == FlightPhase::Flying
    }

    pub(crate) fn home(&self) -> HomePosition {
        self.home
    }

    pub(crate) fn set_home(&mut self, place: Place) {
        self.home.at = place.at;
        self.home.ground_amsl_m = place.alt_amsl_m;
    }

    /// Where it is, as it estimates.
    pub(crate) fn here(&self) -> Place {
        Place {
            at: Enu::new(self.sensed.east_m, self.sensed.north_m),
            alt_amsl_m: self.sensed.alt_amsl_m,
        }
    }

    /// How far its mission has been flown.
    pub(crate) fn mission(&self) -> &MissionRun {
        &self.mission
    }

    /// What its mission did since the last call.
    pub(crate) fn take_events(&mut self) -> Vec<MissionEvent> {
        std::mem::take(&mut self.events)
    }

    /// What guides it now.
    pub(crate) fn guidance(&self) -> Guidance {
        let status = self.craft.status();
        let target = match (self.mode, self.target.path) {
            (AUTO, _) => self.mission.target(),
            (RTL, _) => self.return_to,
            (TAKEOFF, _) => None,
            (
                _,
                Path::Orbit {
                    north_m, east_m, ..
                }
                | Path::GoTo { north_m, east_m },
            ) if !is_manual(self.mode) => Some(Place {
                at: Enu::new(east_m, north_m),
                alt_amsl_m: self.target.alt_amsl_m,
            }),
            _ => None,
        };
        Guidance {
            bank_rad: status.bank_command_rad,
            pitch_rad: status.pitch_command_rad,
            target,
            across_m: self.mission.across_m(self.here().at),
            airspeed_m_s: self.airspeed_m_s,
        }
    }

    pub(crate) fn sticks(&self) -> Sticks {
        self.sticks
    }

    pub(crate) fn set_armed(&mut self, armed: bool) {
        self.armed = armed;
        if !armed {
            self.craft.reset();
            if self.mode == AUTO {
                self.mission.reset();
            }
        }
    }

    pub(crate) fn set_sticks(&mut self, sticks: Sticks) {
        self.sticks = sticks;
    }

    /// Enters a mode; false if it has no such mode.
    pub(crate) fn set_mode(&mut self, mode: u32, parameters: &AutopilotParameters) -> bool {
        let known = MODES.iter().any(|&(m, _)| m == mode) || (mode == LAND && self.craft.hovers());
        if known && mode != self.mode {
            if mode == AUTO {
                self.mission.start_or_resume();
            } else {
                self.mission.stop();
            }
            self.mode = mode;
            self.airspeed_m_s = self.cruise_m_s;
            self.climbing = mode == TAKEOFF;
            self.held = [None; 3];
            self.lifting_to_m = None;
            self.descends = false;
            self.return_to = None;
            self.loiter_here(parameters);
        }
        known
    }

    /// Goes on with another item of its mission; false if there is none of that number.
    pub(crate) fn set_mission_item(&mut self, index: usize, orders: &Orders) -> bool {
        let found = self.mission.set_current(index, orders.mission);
        if found && self.mode == AUTO {
            self.mission.start_or_resume();
        }
        found
    }

    fn loiter_here(&mut self, parameters: &AutopilotParameters) {
        let here = self.sensed;
        self.set_orbit(
            Enu::new(here.east_m, here.north_m),
            parameters.get(WP_LOITER_RAD).abs(),
            parameters.get(WP_LOITER_RAD) >= 0.0,
        );
        self.target.alt_amsl_m = here.alt_amsl_m;
    }

    /// Gives GUIDED its place, which a multirotor does not circle.
    pub(crate) fn set_orbit(&mut self, at: Enu, radius_m: f64, clockwise: bool) {
        self.lifting_to_m = None;
        let (north_m, east_m) = (at.north_m, at.east_m);
        self.target.path = if self.craft.hovers() {
            Path::GoTo { north_m, east_m }
        } else {
            Path::Orbit {
                north_m,
                east_m,
                radius_m,
                clockwise,
            }
        };
    }

    /// Whether it can stand still in the air.
    pub(crate) fn hovers(&self) -> bool {
        self.craft.hovers()
    }

    /// Takes off upwards, in GUIDED.
    pub(crate) fn lift_off(&mut self, above_home_m: f64) {
        self.lifting_to_m = Some(self.home.ground_amsl_m + above_home_m);
    }

    /// Gives GUIDED its speed over ground, m/s.
    pub(crate) fn set_ground_speed(&mut self, m_s: f64) {
        self.airspeed_m_s = m_s;
    }

    /// Gives GUIDED its altitude.
    pub(crate) fn set_altitude(&mut self, alt_amsl_m: f64) {
        self.target.alt_amsl_m = alt_amsl_m;
    }

    /// Gives GUIDED a course over ground or a heading instead of a place, degrees.
    pub(crate) fn set_direction(&mut self, deg: f64, over_ground: bool) {
        self.target.path = if over_ground {
            Path::Course { deg }
        } else {
            Path::Heading { deg }
        };
    }

    /// Gives GUIDED and AUTO their equivalent airspeed, m/s, until the mode changes; -2 is the usual
    /// one. False outside the limits.
    pub(crate) fn set_airspeed(
        &mut self,
        eas_m_s: f64,
        eas_over_tas: f64,
        parameters: &AutopilotParameters,
    ) -> bool {
        if self.craft.hovers() {
            // Of a multirotor it is a speed over ground.
            let sound = eas_m_s > 0.0 && eas_m_s.is_finite();
            if sound {
                self.airspeed_m_s = eas_m_s;
            }
            return sound;
        }
        let limits = parameters.get(AIRSPEED_MIN)..=parameters.get(AIRSPEED_MAX);
        if eas_m_s == -2.0 {
            self.airspeed_m_s = self.cruise_m_s;
        } else if limits.contains(&eas_m_s) {
            self.airspeed_m_s = eas_m_s / eas_over_tas;
        } else {
            return false;
        }
        true
    }

    /// Holds bank and pitch, rad, and throttle that a ground station sends in GUIDED; those that are none stay as they are.
    pub(crate) fn hold(&mut self, sent: [Option<f64>; 3], time_s: f64) {
        for (held, sent) in self.held.iter_mut().zip(sent) {
            *held = sent.map(|value| (value, time_s)).or(*held);
        }
    }

    /// What is held at `time_s`, if anything is.
    fn held(&self, time_s: f64) -> Option<HeldAttitude> {
        let lasts = |held: Option<(f64, f64)>| {
            held.filter(|(_, at)| time_s - at < HELD_S)
                .map(|(value, _)| value)
        };
        let [bank_rad, pitch_rad, throttle] = self.held.map(lasts);
        let held = HeldAttitude {
            bank_rad,
            pitch_rad,
            throttle,
        };
        (self.mode == GUIDED && held != HeldAttitude::default()).then_some(held)
    }

    /// Flies for `dt_s` up to `time_s`.
    pub(crate) fn advance(
        &mut self,
        dt_s: f64,
        time_s: f64,
        reality: &mut Reality,
        orders: &Orders,
        rng: &mut ChaCha8Rng,
    ) {
        let span_s = dt_s.clamp(0.0, LONGEST_PAUSE_S);
        // A pause of rounding errors is no step.
        // The autopilot's loops are tuned for 50 Hz: a longer tick is flown in several steps.
        let steps = (span_s / LOOP_S - 1e-6).ceil().max(0.0);
        for _ in 0..steps as usize {
            self.step(span_s / steps, time_s, reality, orders, rng);
        }
    }

    fn step(
        &mut self,
        dt_s: f64,
        time_s: f64,
        reality: &mut Reality,
        orders: &Orders,
        rng: &mut ChaCha8Rng,
    ) {
        let state = self.craft.state();
        self.slow_s += dt_s;
        if self.slow_s >= SLOW_S - 1e-9 {
            reality.update_mean_air(&state, time_s);
            self.craft.set_ground_amsl_m(reality.ground_amsl_m(&state));
            let wind = reality.around().wind_ned_m_s;
            let flying = state.phase == FlightPhase::Flying;
            self.estimator.step(self.slow_s, wind, flying, rng);
            self.slow_s = 0.0;
        }
        let around = reality.step_gusts(dt_s, state.airspeed_m_s, rng);
        self.sensed = self
            .estimator
            .sensed(&self.craft.sensed(), around.density_kg_m3);
        let mission_path = self.fly_mission(time_s, reality, orders);
        self.fly((dt_s, time_s), &around, mission_path, reality, orders);
        let landed = self.craft.state().phase == FlightPhase::OnGround;
        let landing = match self.mode {
            AUTO => self.mission.is_landing(orders.mission),
            RTL | LAND => self.craft.hovers(),
            _ => false,
        };
        if landing && self.armed && landed {
            self.set_armed(false);
        }
    }

    /// The path of its mission at this moment; none in any mode but AUTO.
    fn fly_mission(
        &mut self,
        time_s: f64,
        reality: &Reality,
        orders: &Orders,
    ) -> Option<(Path, f64)> {
        if self.mode != AUTO {
            return None;
        }
        let path = self.mission.fly(&Surroundings {
            items: orders.mission,
            sensed: &self.sensed,
            home: self.home,
            parameters: orders.parameters,
            reality,
            time_s,
        });
        for event in self.mission.take_events() {
            match event {
                MissionEvent::Mode(mode) => {
                    self.set_mode(mode, orders.parameters);
                }
                MissionEvent::Speed(0.0, m_s) => {
                    let eas_over_tas = reality.eas_over_tas();
                    self.set_airspeed(f64::from(m_s), eas_over_tas, orders.parameters);
                }
                MissionEvent::Home(place) => {
                    self.set_home(place.unwrap_or(self.here()));
                    self.events.push(MissionEvent::Home(None));
                }
                event => self.events.push(event),
            }
        }
        path
    }

    /// Flies for `dt_s` at `time_s`: disarmed, by sticks, or by what the mode demands.
    fn fly(
        &mut self,
        (dt_s, time_s): (f64, f64),
        around: &AirAround,
        mission_path: Option<(Path, f64)>,
        reality: &Reality,
        orders: &Orders,
    ) {
        let held = self.held(time_s);
        if !self.armed {
            self.craft.rest(dt_s, around);
        } else if held.is_none() && is_manual(self.mode) {
            self.craft
                .fly_by_wire(dt_s, around, &self.sensed, &self.sticks);
        } else {
            let demand = self.demand(mission_path, reality, orders);
            self.craft
                .fly_held(dt_s, around, &self.sensed, &demand, held.as_ref());
        }
    }

    /// Where RTL leads: to the nearest rally point, else home.
    fn place_of_return(&mut self, reality: &Reality, orders: &Orders) -> Place {
        if let Some(place) = self.return_to {
            return place;
        }
        let here = self.here().at;
        let distance_m = |place: &Place| place.at.distance_m(here);
        let home = Place {
            at: self.home.at,
            alt_amsl_m: self.home.ground_amsl_m + orders.parameters.return_above_home_m(),
        };
        let rally = orders.rally.iter().map(|point| Place {
            at: crate::fence::local((point.x, point.y), &reality.frame),
            alt_amsl_m: self.home.ground_amsl_m + f64::from(point.z),
        });
        let nearest = rally
            .filter(|place| distance_m(place) <= RALLY_WITHIN_M)
            .min_by(|a, b| distance_m(a).total_cmp(&distance_m(b)));
        *self.return_to.insert(nearest.unwrap_or(home))
    }

    /// Down at a place once it is above it; else there, not lower than it was.
    fn down_at(&self, place: Place, is_above: bool, reality: &Reality) -> (Path, f64) {
        let (north_m, east_m) = (place.at.north_m, place.at.east_m);
        let alt_amsl_m = place.alt_amsl_m.max(self.target.alt_amsl_m);
        if !is_above {
            return (Path::GoTo { north_m, east_m }, alt_amsl_m);
        }
        let land = Path::Land {
            north_m,
            east_m,
            ground_amsl_m: reality.ground_at_amsl_m(place.at),
            course_deg: None,
        };
        (land, alt_amsl_m)
    }

    /// Where the mode was entered, or where it was sent since.
    fn target_place(&self) -> Place {
        let at = match self.target.path {
            Path::GoTo { north_m, east_m } => Enu::new(east_m, north_m),
            _ => self.here().at,
        };
        Place {
            at,
            alt_amsl_m: self.target.alt_amsl_m,
        }
    }

    fn demand(
        &mut self,
        mission_path: Option<(Path, f64)>,
        reality: &Reality,
        orders: &Orders,
    ) -> Demand {
        let home = self.home;
        let parameters = orders.parameters;
        let circle = |at: Enu| Path::Orbit {
            north_m: at.north_m,
            east_m: at.east_m,
            radius_m: parameters.get(WP_LOITER_RAD).abs(),
            clockwise: parameters.get(WP_LOITER_RAD) >= 0.0,
        };
        let (path, alt_amsl_m) = match self.mode {
            GUIDED if self.lifting_to_m.is_some() => {
                let up_m = self.lifting_to_m.unwrap_or(self.target.alt_amsl_m);
                let upwards = Path::TakeOff {
                    heading_deg: home.heading_deg,
                };
                (upwards, up_m)
            }
            RTL if self.craft.hovers() => {
                let place = self.place_of_return(reality, orders);
                self.descends |= place.at.distance_m(self.here().at) < ABOVE_HOME_M;
                self.down_at(place, self.descends, reality)
            }
            LAND => self.down_at(self.target_place(), true, reality),
            TAKEOFF => {
                let up_m = home.ground_amsl_m + parameters.get(TKOFF_ALT);
                self.climbing &= self.sensed.alt_amsl_m < up_m - CLIMB_DONE_M;
                let ahead = Path::TakeOff {
                    heading_deg: home.heading_deg,
                };
                let path = if self.climbing {
                    ahead
                } else {
                    circle(home.at)
                };
                (path, up_m)
            }
            RTL => {
                let place = self.place_of_return(reality, orders);
                (circle(place.at), place.alt_amsl_m)
            }
            AUTO => mission_path.unwrap_or((self.target.path, self.target.alt_amsl_m)),
            _ => (self.target.path, self.target.alt_amsl_m),
        };
        Demand {
            path,
            alt_amsl_m,
            airspeed_m_s: self.airspeed_m_s + self.slow_over_ground_m_s(reality, parameters),
        }
    }

    /// What the airspeed lacks for the least ground speed asked for, m/s, as far as the airframe's
    /// limit goes.
    fn slow_over_ground_m_s(&self, reality: &Reality, parameters: &AutopilotParameters) -> f64 {
        let least_m_s = parameters.get(MIN_GROUNDSPEED);
        if least_m_s <= 0.0 {
            return 0.0;
        }
        let [north, east, _] = self.sensed.vel_ned_m_s;
        let fastest_m_s = parameters.get(AIRSPEED_MAX) / reality.eas_over_tas();
        (least_m_s - north.hypot(east)).clamp(0.0, (fastest_m_s - self.airspeed_m_s).max(0.0))
    }
}

/// Sticks let go: level flight at a little more than half power.
const CENTRED: Sticks = Sticks {
    roll: 0.0,
    pitch: 0.0,
    throttle: 0.55,
};

/// The modes that it has, with their names as AVAILABLE_MODES tells them.
pub(crate) const MODES: [(u32, &str); 14] = [
    (MANUAL, "Manual"),
    (CIRCLE, "Circle"),
    (2, "Stabilize"),
    (3, "Training"),
    (4, "Acro"),
    (FBWA, "FBWA"),
    (6, "FBWB"),
    (7, "Cruise"),
    (8, "Autotune"),
    (AUTO, "Auto"),
    (RTL, "RTL"),
    (LOITER, "Loiter"),
    (GUIDED, "Guided"),
    (TAKEOFF, "Takeoff"),
];

/// Modes in which a pilot's sticks fly; all of them with stabilisation here.
pub(crate) fn is_manual(mode: u32) -> bool {
    matches!(mode, MANUAL | FBWA) || (2..=4).contains(&mode) || (6..=8).contains(&mode)
}
