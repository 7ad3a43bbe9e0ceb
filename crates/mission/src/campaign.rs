//! Missions of a campaign: the scenario flown in other realities, by other strategies, with other teams and seeds, and
//! what came of each.

use crate::{MissionError, Run, Setup, truth};
use air::geo::{Enu, Geodetic, LocalFrame};
use protocol::message::{Message, Model, Peak, PeakStatus, State};
use protocol::{Envelope, SimTime, Topic};
use record::campaign::{MissionKey, MissionRow, Moment, NEAR_M, Reality};
use record::summary::{MissionSummary, Summariser, SummaryContext, TruePeak};
use scenario::Scenario;
use scenario::tables::{HomeTable, VehicleKind};
use scenario::uncertain::Uncertain;

/// What a summary needs to know of a scenario beside its messages.
///
/// # Errors
/// A scenario that describes no world.
pub fn summary_context(setup: &Setup) -> Result<SummaryContext, MissionError> {
    let scenario = &setup.scenario;
    let has_reality = truth::has_stand_in(scenario);
    let reality = has_reality
        .then(|| truth::reality_numbers(scenario))
        .transpose()?;
    let true_peak = has_reality.then(|| truth::true_peak(setup)).transpose()?;
    let true_flux = if has_reality {
        truth::true_flux(scenario)?
    } else {
        Vec::new()
    };
    let frame = setup.frame()?;
    let world = scenario.dispersion_spec()?;
    let source = world.sources.first().map_or(Enu::default(), |s| s.place);
    let source = frame.to_geodetic(source);
    Ok(SummaryContext {
        source_deg: (source.lat_deg, source.lon_deg),
        noise_ppm: world.sensor.noise_sd_ppm.max(world.sensor.resolution_ppm),
        gas: scenario.gas(),
        scenario: scenario.clone(),
        seed: scenario.mission.seed,
        team: scenario.vehicles.iter().map(|v| v.id.clone()).collect(),
        frame,
        before: truth::numbers(scenario)?,
        reality,
        true_peak,
        true_flux,
    })
}

/// Flies one mission in virtual time and summarises it; `wall_s` of the summary is zero. Not to be called on a thread of
/// rayon's pool, as by `par_iter`: it waits for computations that need a free thread there.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly(setup: &Setup) -> Result<MissionSummary, MissionError> {
    flown(setup, summary_context(setup)?, &mut |_, _, _| ())
}

/// The same, with what `watch` makes of each message after the summariser has taken it.
fn flown(
    setup: &Setup,
    context: SummaryContext,
    watch: &mut impl FnMut(&Topic, &Envelope, &Summariser),
) -> Result<MissionSummary, MissionError> {
    // A campaign flies as many missions at a time as there are processors.
    let mut run = Run::new(setup)?.on_one_thread();
    let mut summariser = Summariser::new(context);
    while !run.ended() {
        for (topic, envelope) in run.step() {
            summariser.take(topic, envelope);
            watch(topic, envelope, &summariser);
        }
    }
    Ok(summariser.summary(&run.digest(), 0.0))
}

/// Flies the mission of `key`, whose setup is that of [`in_case`], and tells what came of it.
///
/// # Errors
/// A mission that cannot be flown.
pub fn fly_row(setup: &Setup, key: MissionKey) -> Result<MissionRow, MissionError> {
    let mut setup = setup.clone();
    setup.scenario.mission.seed = key.seed;
    let context = summary_context(&setup)?;
    let has_peak = context.true_flux.iter().any(|(_, kg_s)| *kg_s > 0.0);
    let mut watch = Watch {
        frame: context.frame,
        peak: context.true_peak.clone().filter(|_| has_peak),
        is_steady: truth::is_steady(&setup),
        peak_at: None,
        near: None,
        known: None,
        confirmed: None,
        model: None,
    };
    let summary = flown(&setup, context, &mut |topic, envelope, so_far| {
        watch.take(topic, envelope, so_far);
    })?;
    let time_s = summary.peak.estimate.map_or(summary.sim_s, |p| p.time_s);
    let map = match watch.model.filter(|_| truth::has_stand_in(&setup.scenario)) {
        Some(model) => truth::map_error(&setup, &model, time_s)?,
        None => None,
    };
    let vehicles = setup.scenario.vehicles.iter();
    let real = vehicles
        .filter(|v| v.kind != VehicleKind::Simulated)
        .count();
    let moments = [watch.near, watch.known, watch.confirmed];
    Ok(MissionRow::new(
        key,
        (real, has_peak),
        &summary,
        moments,
        map,
    ))
}

/// The true peak is looked for anew after this time where it moves, s.
const PEAK_MOVES_S: f64 = 60.0;

/// What of a mission's messages tells how fast it was.
struct Watch {
    frame: LocalFrame,
    peak: Option<TruePeak>,
    is_steady: bool,
    /// When the true peak was last looked for, s, and where it was: height above mean sea level.
    peak_at: Option<(f64, Option<(Enu, f64)>)>,
    near: Option<Moment>,
    known: Option<Moment>,
    confirmed: Option<Moment>,
    model: Option<Box<Model>>,
}

impl Watch {
    fn take(&mut self, topic: &Topic, envelope: &Envelope, so_far: &Summariser) {
        let moment = |time: SimTime| Moment {
            time_s: time.s(),
            flown_km: so_far.flown_m() / 1000.0,
        };
        match (topic, &envelope.message) {
            (Topic::State(_), Message::State(state))
                if self.near.is_none()
                    && state.airborne
                    && self.is_near(state, envelope.time.s()) =>
            {
                self.near = Some(moment(envelope.time));
            }
            (Topic::Model, Message::Model(model)) => {
                if self.known.is_none() && so_far.known_s().is_some() {
                    self.known = Some(moment(envelope.time));
                }
                let is_confirmed = |p: Peak| p.status == PeakStatus::Confirmed;
                if self.confirmed.is_none()
                    && self.known.is_some()
                    && model.peak.is_some_and(is_confirmed)
                {
                    self.confirmed = Some(moment(envelope.time));
                }
                self.model = Some(model.clone());
            }
            _ => {}
        }
    }

    fn is_near(&mut self, state: &State, time_s: f64) -> bool {
        let Some((at, alt_amsl_m)) = self.peak_at(time_s) else {
            return false;
        };
        let here = self
            .frame
            .to_enu(Geodetic::new(state.lat_deg, state.lon_deg));
        here.distance_m(at).hypot(state.alt_amsl_m - alt_amsl_m) <= NEAR_M
    }

    fn peak_at(&mut self, time_s: f64) -> Option<(Enu, f64)> {
        let is_old = |from_s: f64| !self.is_steady && time_s - from_s >= PEAK_MOVES_S;
        if self.peak_at.is_none_or(|(from_s, _)| is_old(from_s)) {
            let found = self.peak.as_ref().and_then(|p| p.0(time_s)).map(|p| {
                let at = Geodetic::new(p.lat_deg, p.lon_deg);
                (self.frame.to_enu(at), p.alt_amsl_m)
            });
            self.peak_at = Some((time_s, found));
        }
        self.peak_at.and_then(|(_, at)| at)
    }
}

/// The setup of `strategy` with a team of `vehicles` in a reality. `read` reads files that the reality names.
///
/// # Errors
/// A reality, a strategy or a team that cannot be.
pub fn in_case(
    setup: &Setup,
    reality: &Reality,
    strategy: &str,
    vehicles: usize,
    read: crate::setup::ReadFile<'_>,
) -> Result<Setup, MissionError> {
    let scenario = &setup.scenario;
    let scenario = match &reality.text {
        Some(text) => scenario.in_reality_of(&reality.name, text)?,
        None => scenario.in_other_reality(&reality.name)?,
    };
    let mut scenario = with_team_of(&scenario, vehicles)?;
    scenario.search.strategy = strategy.to_owned();
    if strategy == ORACLE {
        scenario = knowing_the_axis(scenario);
    }
    let kept = |name: &str| match setup.files.get(name) {
        Some(bytes) => Ok(bytes.clone()),
        None => read(name),
    };
    Setup::load(&reality.name, &scenario.to_toml(), &kept)
}

/// The name of a strategy that no team has, for comparison: it knows beforehand where the plume is, and flies passes at once.
pub const ORACLE: &str = "oracle";
/// What it flies by then.
const OF_THE_ORACLE: &str = "posterior";
/// How well it knows the axis: to a tenth of the width of a plume as seen from its source, degrees, and of its height, m.
const ORACLE_SD: [f64; 2] = [0.5, 5.0];

/// The scenario with direction of the wind and height of the plume as they are in its reality.
fn knowing_the_axis(mut scenario: Scenario) -> Scenario {
    let reality = scenario.in_reality();
    scenario.weather.wind_from_deg = reality.weather.wind_from_deg;
    let sources = scenario.sources.iter_mut().zip(&reality.sources);
    for (source, real) in sources {
        source.effective_height_m = real.effective_height_m;
    }
    for (key, sd) in [Uncertain::WindFrom, Uncertain::EffectiveHeight]
        .into_iter()
        .zip(ORACLE_SD)
    {
        scenario.uncertain.insert(key.key(scenario.gas()), sd);
    }
    scenario.search.strategy = OF_THE_ORACLE.to_owned();
    scenario
}

/// Largest team of a campaign: that with which the rules of the airspace were tried.
const MOST_VEHICLES: usize = 100;
/// Homes of vehicles that a scenario does not have lie beyond those that it has, this far from them at least, m.
const BESIDE_HOMES_M: f64 = 100.0;

/// The scenario with a team of `count`: those that are not simulated first, then simulated ones as they come. Of more
/// than there are the simulated ones are repeated, their homes in further rows away from the first source.
///
/// # Errors
/// An empty team, or one that needs simulated vehicles of a scenario without any.
fn with_team_of(scenario: &Scenario, count: usize) -> Result<Scenario, MissionError> {
    let is_simulated = |k: &usize| scenario.vehicles[*k].kind == VehicleKind::Simulated;
    let (simulated, real): (Vec<usize>, Vec<usize>) =
        (0..scenario.vehicles.len()).partition(is_simulated);
    let more = count.saturating_sub(real.len());
    if !(1..=MOST_VEHICLES).contains(&count) || (simulated.is_empty() && more > 0) {
        return Err(MissionError::Request(format!(
            "a team of {count} vehicles; expected 1 to {}{}",
            if simulated.is_empty() {
                real.len()
            } else {
                MOST_VEHICLES
            },
            if simulated.is_empty() {
                ", since the team has no simulated vehicle to repeat"
            } else {
                ""
            },
        )));
    }
    let mut chosen: Vec<usize> = real.into_iter().rev().take(count).collect();
    chosen.extend(simulated.iter().copied().take(more));
    chosen.sort_unstable();
    let mut team: Vec<_> = chosen
        .iter()
        .map(|k| scenario.vehicles[*k].clone())
        .collect();
    let frame = scenario.frame()?;
    let source = &scenario.sources[0];
    let source = frame.to_enu(Geodetic::new(source.lat_deg, source.lon_deg));
    let homes: Result<Vec<Enu>, _> = (0..scenario.vehicles.len())
        .map(|k| scenario.home(k).map(|at| frame.to_enu(at)))
        .collect();
    let homes = homes?;
    let between = homes
        .iter()
        .flat_map(|a| homes.iter().map(|b| a.distance_m(*b)));
    let apart_m = BESIDE_HOMES_M + between.fold(0.0, f64::max);
    for k in simulated.len()..more {
        let like = simulated[k % simulated.len()];
        let home = frame.to_enu(scenario.home(like)?);
        let row = (k / simulated.len()) as f64;
        let away = home.displaced(source.bearing_deg(home), apart_m * row);
        let at = frame.to_geodetic(away);
        let mut vehicle = scenario.vehicles[like].clone();
        vehicle.home = Some(HomeTable {
            lat_deg: at.lat_deg,
            lon_deg: at.lon_deg,
        });
        let number = team.len() + 1;
        let taken = |id: &str| team.iter().any(|v| v.id == id);
        vehicle.id = (number..)
            .map(|n| n.to_string())
            .find(|id| !taken(id))
            .unwrap_or_default();
        team.push(vehicle);
    }
    Ok(Scenario {
        vehicles: team,
        ..scenario.clone()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn as_pontes() -> Setup {
        let text = include_str!("../../../scenarios/as-pontes.toml");
        let nothing = |_: &str| Err("no such file".to_owned());
        Setup::load("as-pontes.toml", text, &nothing).unwrap()
    }

    #[test]
    fn teams_of_any_size_keep_the_real_ones() {
        let scenario = as_pontes().scenario;
        let frame = scenario.frame().unwrap();
        for count in [1, 2, 6, 12, 30] {
            let team = with_team_of(&scenario, count).unwrap();
            assert_eq!(team.vehicles.len(), count);
            let real = team
                .vehicles
                .iter()
                .filter(|v| v.kind == VehicleKind::StandIn);
            assert_eq!(real.count(), 1);
            let home = |k: usize| frame.to_enu(team.home(k).unwrap());
            for a in 0..count {
                for b in 0..a {
                    assert_ne!(team.vehicles[a].id, team.vehicles[b].id);
                    assert!(home(a).distance_m(home(b)) > 40.0, "{count}: {a} and {b}");
                }
            }
        }
        assert_eq!(with_team_of(&scenario, 6).unwrap(), scenario);
        assert!(with_team_of(&scenario, 0).is_err());
        let all_real = as_pontes().with_stand_ins(6).unwrap().scenario;
        let refused = with_team_of(&all_real, 7).unwrap_err().to_string();
        assert!(refused.contains("1 to 6"), "{refused}");
    }

    /// The reality of as-pontes blows from 252 degrees and has its plume at 540 m; a reality that turns keeps its turn.
    #[test]
    fn the_oracle_knows_the_axis_and_changes_no_reality() {
        let nothing = |_: &str| Err("no such file".to_owned());
        for name in ["steady", "drift"] {
            let reality = Reality {
                name: name.to_owned(),
                text: None,
            };
            let of = |strategy| in_case(&as_pontes(), &reality, strategy, 6, &nothing).unwrap();
            let (oracle, plain) = (of(ORACLE).scenario, of(OF_THE_ORACLE).scenario);
            assert_eq!(oracle.weather.wind_from_deg, 252.0);
            assert_eq!(oracle.sources[0].effective_height_m, Some(540.0));
            assert_eq!(oracle.search.strategy, OF_THE_ORACLE);
            let [there, here] = [oracle, plain].map(|s| s.in_reality());
            assert_eq!((there.weather, there.sources), (here.weather, here.sources));
            assert_eq!(there.mechanisms, here.mechanisms);
        }
    }

    #[test]
    fn a_row_tells_what_the_mission_came_to() {
        let reality = Reality {
            name: "steady".to_owned(),
            text: None,
        };
        let nothing = |_: &str| Err("no such file".to_owned());
        let mut setup = in_case(&as_pontes(), &reality, "posterior", 2, &nothing).unwrap();
        setup.scenario.mission.duration_s = 1500.0;
        let key = MissionKey {
            reality: reality.name,
            strategy: "posterior".to_owned(),
            vehicles: 2,
            seed: 3,
        };
        let row = fly_row(&setup, key.clone()).unwrap();
        assert_eq!((row.key.clone(), row.real, row.has_peak), (key, 1, true));
        // The same mission as it is flown alone.
        setup.scenario.mission.seed = 3;
        let alone = fly(&setup).unwrap();
        assert_eq!(row.digest, alone.digest);
        assert_eq!(row.known.map(|m| m.time_s), alone.peak.known_s);
        assert_eq!(row.peak_off_m, alone.peak.error_m);
        let known = row.known.expect("known within 25 minutes");
        assert!(known.flown_km > 0.0 && known.flown_km < row.flown_km);
        // A map without a plume would be off by the plume itself.
        let map = row.map.unwrap();
        assert!(map.rmse_ppm < 0.5 * map.plume_rms_ppm, "{map:?}");
    }
}
