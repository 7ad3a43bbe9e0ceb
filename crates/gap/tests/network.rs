//! Networks of fixed sensors, made here by a plume of this file's own: Gauss with Briggs' rural class D (1973) over
//! ground that sends everything back, in air of 15 °C and 1013.25 hPa.

use gap::plume::{Options, Setup, analyse};
use gap::verdict::{GapJson, Verdict};
use plume::Gas;
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use scenario::Scenario;
use scenario::observations::parse;

const EMISSION_KG_S: f64 = 1e-3;
const SPEED_M_S: f64 = 3.0;
const FAR_M: f64 = 60.0;
const SOURCE_M: f64 = 3.0;
const SENSOR_M: f64 = 2.0;
const NOISE_PPM: f64 = 0.03;
/// ppm of one kg/m³ of methane: R T / (p M).
const PPM_PER_KG_M3: f64 = 1e6 * 8.314_462_6 * 288.15 / (101_325.0 * 0.016_043);

/// Above the background at `FAR_M` from the source, `off_deg` off the wind.
fn plume_ppm(off_deg: f64) -> f64 {
    let (sin, cos) = off_deg.to_radians().sin_cos();
    plume_at_ppm(FAR_M * cos, FAR_M * sin)
}

/// The same so far downwind and across the wind.
fn plume_at_ppm(x: f64, y: f64) -> f64 {
    if x < 1.0 {
        return 0.0;
    }
    let sigma_y = 0.08 * x / (1.0 + 1e-4 * x).sqrt();
    let sigma_z = 0.06 * x / (1.0 + 1.5e-3 * x).sqrt();
    let bell = |d: f64, sigma: f64| (-0.5 * (d / sigma).powi(2)).exp();
    let up = bell(SENSOR_M - SOURCE_M, sigma_z) + bell(SENSOR_M + SOURCE_M, sigma_z);
    let tau = std::f64::consts::TAU;
    PPM_PER_KG_M3 * EMISSION_KG_S / (tau * SPEED_M_S * sigma_y * sigma_z) * bell(y, sigma_y) * up
}

fn world() -> String {
    format!(
        "[site]\nlat_deg = 40.0\nlon_deg = -105.0\nground_amsl_m = 0.0\n\
         [weather]\nwind_speed_m_s = {SPEED_M_S}\nwind_height_agl_m = 2.0\nwind_from_deg = 200.0\n\
         wind_exponent = 0.0\nstability = \"D\"\ntemperature_c = 15.0\npressure_hpa = 1013.25\n\
         [[source]]\ngas = \"ch4\"\nlat_deg = 40.0\nlon_deg = -105.0\neffective_height_m = {SOURCE_M}\n\
         emission_kg_s = {EMISSION_KG_S}\n[plume]\nground_reflection = true\n\
         [background]\nch4_ppm = 1.9\n[sensor]\nnoise_sd_ppm = {NOISE_PPM}\n\
         [uncertain]\n\"background.ch4_ppm\" = 0.2\n\"source.emission_kg_s\" = 0.0003\n"
    )
}

/// A log of four sensors round the source, with these zeros and gains, of a row each minute while the wind turns
/// by 2° each minute.
fn log(zeros_ppm: [f64; 4], gains: [f64; 4]) -> String {
    log_of(zeros_ppm, gains, &|_| 1.0)
}

/// The same of a source whose emission is at each time so many times `EMISSION_KG_S`.
fn log_of(zeros_ppm: [f64; 4], gains: [f64; 4], emitted: &dyn Fn(f64) -> f64) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(7);
    let mut out = String::from(
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,wind_speed_m_s,wind_from_deg\n",
    );
    // Metres of a degree on WGS84 at 40°: north, east.
    let places = [(60.0, 0.0), (0.0, 60.0), (-60.0, 0.0), (0.0, -60.0)];
    for minute in 0..360 {
        let from_deg = (200.0 + 2.0 * f64::from(minute)) % 360.0;
        for (k, (north_m, east_m)) in places.into_iter().enumerate() {
            let bearing = 90.0 * k as f64;
            let off_deg = (from_deg + 180.0 - bearing + 180.0).rem_euclid(360.0) - 180.0;
            let noise: f64 = StandardNormal.sample(&mut rng);
            // Air is under way for as long as it takes to where it is read, straight downwind.
            let left_s = f64::from(60 * minute) - FAR_M * off_deg.to_radians().cos() / SPEED_M_S;
            let plume = emitted(left_s) * plume_ppm(off_deg);
            let read = zeros_ppm[k] + gains[k] * plume + NOISE_PPM * noise;
            let (lat, lon) = (40.0 + north_m / 111_035.0, -105.0 + east_m / 85_394.0);
            out += &format!(
                "{},s{k},{lat},{lon},{SENSOR_M},{read:.4},{SPEED_M_S},{from_deg}\n",
                60 * minute
            );
        }
    }
    out
}

fn answer(zeros_ppm: [f64; 4], gains: [f64; 4]) -> GapJson {
    let scenario = Scenario::parse("network", &world()).unwrap();
    let setup = Setup::new(&scenario).unwrap();
    let observations = parse(&[("log", &log(zeros_ppm, gains))], Gas::Ch4).unwrap();
    let options = Options::default();
    analyse(&setup, &observations, &options, &mut |_| ())
        .unwrap()
        .json
}

#[test]
fn zeros_and_gains_of_a_network_are_of_the_base() {
    let (zeros, gains) = ([1.7, 2.1, 1.9, 1.85], [1.0, 1.0, 1.0, 1.2]);
    let json = answer(zeros, gains);
    let of = |name: &str, k: usize| {
        let platform = format!("s{k}");
        let own = json.base.iter();
        own.clone()
            .find(|b| b.name == name && b.platform.as_ref() == Some(&platform))
            .unwrap_or_else(|| panic!("{name} of {platform}: {:?}", json.base))
    };
    for (k, zero) in zeros.into_iter().enumerate() {
        let found = of("zero_ppm", k);
        let off = found.value - zero;
        assert!(
            off.abs() < 0.01 && off.abs() < 3.0 * found.sd,
            "{k}: {found:?}"
        );
        assert!(found.sd < 0.01);
    }
    let emission = json.base.iter().find(|b| b.name == "source.emission_kg_s");
    let emission = emission.unwrap();
    // Readings tell gain times emission: their ratio to the others is what is known of the fourth.
    let fourth = of("gain", 3).value / ((0..3).map(|k| of("gain", k).value).sum::<f64>() / 3.0);
    assert!((fourth - 1.2).abs() < 0.03, "{fourth}");
    assert!(
        (emission.value - EMISSION_KG_S).abs() < 3.0 * emission.sd,
        "{emission:?}"
    );
    assert_eq!(json.verdict, Verdict::None, "{}", json.summary);
}

/// A laser along a line 60 m north of the source, 80 m long, whose readings are means over a minute, and a mast that logs
/// the wind every 10 s: it turns by 3° each, to and fro. The log has `averaging_s` if asked.
fn laser(says_averaging: bool) -> String {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut out = String::from(
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,wind_speed_m_s,wind_from_deg,\
         averaging_s,lat2_deg,lon2_deg,alt2_amsl_m\n",
    );
    let degree = [111_035.0, 85_394.0];
    let lat = 40.0 + 60.0 / degree[0];
    let (west, east) = (-105.0 - 40.0 / degree[1], -105.0 + 40.0 / degree[1]);
    let from_deg = |k: i32| 180.0 + 70.0 * (f64::from(k) * 3.0 / 70.0).sin();
    for minute in 0..120 {
        let (mut sum, moments) = (0.0, 6 * minute..6 * minute + 6);
        for k in moments {
            let (sin, cos) = (from_deg(k) + 180.0).to_radians().sin_cos();
            for part in 0..800 {
                let (e, n) = (-40.0 + 0.1 * (f64::from(part) + 0.5), 60.0);
                sum += plume_at_ppm(e * sin + n * cos, e * cos - n * sin) / (6.0 * 800.0);
            }
            let time_s = 10 * k + 5;
            out += &format!(
                "{time_s},mast,40.0,-105.0,{SENSOR_M},,{SPEED_M_S},{},,,,\n",
                from_deg(k)
            );
        }
        let noise: f64 = StandardNormal.sample(&mut rng);
        let read = 1.9 + sum + NOISE_PPM * noise;
        let averaging = if says_averaging { "60" } else { "" };
        let time_s = 60 * (minute + 1);
        out += &format!(
            "{time_s},laser,{lat},{west},{SENSOR_M},{read:.5},,,{averaging},{lat},{east},{SENSOR_M}\n"
        );
    }
    out
}

#[test]
fn a_laser_that_states_means_tells_the_emission() {
    let scenario = Scenario::parse("laser", &world()).unwrap();
    let setup = Setup::new(&scenario).unwrap();
    let told = |says_averaging: bool| {
        let log = parse(&[("log", &laser(says_averaging))], Gas::Ch4).unwrap();
        let options = Options::default();
        let json = analyse(&setup, &log, &options, &mut |_| ()).unwrap().json;
        let emission = json.base.iter().find(|b| b.name == "source.emission_kg_s");
        (emission.unwrap().clone(), json)
    };
    let (emission, json) = told(true);
    let off = emission.value - EMISSION_KG_S;
    assert!(
        off.abs() < 0.03 * EMISSION_KG_S && off.abs() < 3.0 * emission.sd,
        "{emission:?}"
    );
    assert_eq!(json.verdict, Verdict::None, "{}", json.summary);
    // Taken for moments, the means lie beside their winds: what is left of them is larger.
    let (_, taken_for_moments) = told(false);
    let size = |json: &GapJson| json.discrepancy.as_ref().unwrap().wander_deg;
    assert!(
        taken_for_moments.verdict != Verdict::None || size(&taken_for_moments) > 2.0 * size(&json),
        "{}",
        taken_for_moments.summary
    );
}

/// On for an hour and off for half of one, in turn, as a release is: 1.5 times the mean, of which the scenario states
/// twice as much.
#[test]
fn a_release_by_a_schedule_is_told_as_a_factor_on_it() {
    let is_on = |time_s: f64| time_s.max(0.0).rem_euclid(5400.0) < 3600.0;
    let emitted = |time_s: f64| if is_on(time_s) { 1.5 } else { 0.0 };
    let rows: Vec<String> = (0..4)
        .map(|k| format!("[{}, 1.0], [{}, 0.0]", 5400 * k, 5400 * k + 3600))
        .chain(["[21600, 0.0]".to_owned()])
        .collect();
    let stated = format!(
        "emission_kg_s = {}\nemission_table = [{}]\n",
        2.0 * EMISSION_KG_S,
        rows.join(", ")
    );
    let text = world().replace(&format!("emission_kg_s = {EMISSION_KG_S}\n"), &stated);
    let text = text.replace(
        "\"source.emission_kg_s\" = 0.0003",
        "\"source.emission_kg_s\" = 0.001",
    );
    let zeros = [1.9; 4];
    let told = |text: &str| {
        let scenario = Scenario::parse("release", text).unwrap();
        let setup = Setup::new(&scenario).unwrap();
        let log = log_of(zeros, [1.0; 4], &emitted);
        let observations = parse(&[("log", &log)], Gas::Ch4).unwrap();
        let options = Options::default();
        analyse(&setup, &observations, &options, &mut |_| ())
            .unwrap()
            .json
    };
    let json = told(&text);
    let emission = json.base.iter().find(|b| b.name == "source.emission_kg_s");
    let emission = emission.unwrap();
    let off = emission.value - EMISSION_KG_S;
    assert!(
        off.abs() < 0.05 * EMISSION_KG_S && off.abs() < 3.0 * emission.sd,
        "{emission:?}"
    );
    assert_eq!(json.verdict, Verdict::None, "{}", json.summary);
    // A steady source of the same mean is none of it.
    let steady = text.replace("emission_table", "#");
    assert_ne!(told(&steady).verdict, Verdict::None);
}
