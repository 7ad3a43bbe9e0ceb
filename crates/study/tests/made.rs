//! Records of plumes whose rate is known, by the formula of a Gaussian plume written out here.

pub const SCENARIO: &str = r#"
[site]
lat_deg = 45.0
lon_deg = 5.0
ground_amsl_m = 100.0
[weather]
wind_speed_m_s = 3.0
wind_height_agl_m = 3.0
wind_from_deg = 180.0
stability = "C"
temperature_c = 15.0
pressure_hpa = 1000.0
[[source]]
name = "vent"
gas = "ch4"
lat_deg = 45.0
lon_deg = 5.0
effective_height_m = 2.0
emission_kg_s = 1.0e-3
[plume]
ground_reflection = true
[background]
ch4_ppm = 2.0
[sensor]
noise_sd_ppm = 0.01
"#;

/// Readings 60 m north of the source, by the formula of a Gaussian plume written out here: the wind's direction swings
/// slowly, and the plume follows it. `kg_s` is the rate, `factor` multiplies the excess.
pub fn parked(kg_s: f64, factor: f64) -> String {
    let (distance_m, speed) = (60.0f64, 3.0f64);
    // Briggs, class C at 60 m.
    let sigma_z = 0.08 * distance_m / (1.0 + 0.0002 * distance_m).sqrt();
    let sigma_y = 0.11 * distance_m / (1.0 + 0.0001 * distance_m).sqrt();
    // 1 ppm of CH4 at 1000 hPa and 15 °C: 16.043e-3 / (8.314462 * 288.15 / 1e5) * 1e-6 kg/m3.
    let kg_m3 = 16.043e-3 / (8.314_462 * 288.15 / 1e5) * 1e-6;
    let mut text = String::from(
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,wind_speed_m_s,wind_from_deg\n",
    );
    for k in 0..1800u32 {
        let t = f64::from(k);
        // Incommensurate swings, so that all directions within 45 degrees occur.
        let off: f64 = 25.0 * (t / 37.0).sin() + 15.0 * (t / 101.3).sin() + 8.0 * (t / 11.7).cos();
        let y = distance_m * off.to_radians();
        let bell = |v: f64, s: f64| (-0.5 * (v / s).powi(2)).exp();
        let c = kg_s / (std::f64::consts::TAU * speed * sigma_y * sigma_z)
            * bell(y, sigma_y)
            * (bell(3.0 - 2.0, sigma_z) + bell(3.0 + 2.0, sigma_z));
        let noise = 0.01 * (f64::from(k * 7919 % 101) / 50.0 - 1.0);
        let ppm = 2.0 + factor * (c / kg_m3 + noise);
        text += &format!(
            "{t},car,45.00053992,5.0,103.0,{ppm:.6},{speed},{}\n",
            180.0 + off
        );
    }
    text
}

/// Three sensors around a vent in a wind that goes round, by the formula of a Gaussian plume written out here.
pub fn ring(kg_s: f64, factor: f64) -> String {
    around(kg_s, factor, &[("n", 0.0), ("e", 90.0), ("s", 180.0)])
}

/// The same for sensors 60 m from the vent in these directions, degrees.
pub fn around(kg_s: f64, factor: f64, sensors: &[(&str, f64)]) -> String {
    let mut text = String::from(
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,wind_speed_m_s,wind_from_deg\n",
    );
    let distance_m = 60.0f64;
    let sigma_z = 0.08 * distance_m / (1.0 + 0.0002 * distance_m).sqrt();
    let sigma_z = sigma_z.hypot(2.0 / 2.15);
    let sigma_y = 0.11 * distance_m / (1.0 + 0.0001 * distance_m).sqrt();
    let kg_m3 = 16.043e-3 / (8.314_462 * 288.15 / 1e5) * 1e-6;
    let bell = |v: f64, s: f64| (-0.5 * (v / s).powi(2)).exp();
    for minute in 0..360u32 {
        let from_deg = f64::from(minute * 7 % 360);
        for (k, (name, bearing)) in sensors.iter().enumerate() {
            let (east_m, north_m) = (
                distance_m * bearing.to_radians().sin(),
                distance_m * bearing.to_radians().cos(),
            );
            let off = (from_deg + 180.0 - bearing + 180.0).rem_euclid(360.0) - 180.0;
            let y = distance_m * off.to_radians();
            let c = kg_s / (std::f64::consts::TAU * 3.0 * sigma_y * sigma_z)
                * bell(y, sigma_y)
                * (bell(3.0 - 2.0, sigma_z) + bell(3.0 + 2.0, sigma_z));
            let noise = 0.01 * (f64::from((minute * 7919 + 31 * k as u32) % 101) / 50.0 - 1.0);
            let zero = 1.9 + 0.1 * k as f64;
            let ppm = zero + factor * (c / kg_m3 + noise);
            // Metres of a degree at 45° on WGS84: 111131.7 north, 78846.8 east.
            let (lat, lon) = (45.0 + north_m / 111_131.7, 5.0 + east_m / 78_846.8);
            text += &format!(
                "{},{name},{lat:.8},{lon:.8},103.0,{ppm:.6},3.0,{from_deg}\n",
                60 * minute
            );
        }
    }
    text
}

pub const STACK: &str = r#"
[site]
lat_deg = 45.0
lon_deg = 5.0
ground_amsl_m = 100.0
[weather]
wind_speed_m_s = 8.0
wind_height_agl_m = 150.0
wind_from_deg = 270.0
wind_exponent = 0.15
stability = "D"
temperature_c = 15.0
pressure_hpa = 1000.0
[[source]]
name = "stack"
gas = "ch4"
lat_deg = 45.0
lon_deg = 5.0
stack_height_m = 100.0
effective_height_m = 150.0
emission_kg_s = 1.0
[background]
ch4_ppm = 2.0
[sensor]
noise_sd_ppm = 0.01
"#;

/// Ways of an aircraft across the plume of a stack, 1000 m east of it, twice at each of `heights_agl_m`.
pub fn flown(kg_s: f64, factor: f64, heights_agl_m: &[f64]) -> String {
    across(factor, heights_agl_m, &|_| Moment {
        kg_s,
        sigma_z_part: 1.0,
        up_sigma_z: 0.0,
    })
}

/// The plume of a moment against the mean plume.
pub struct Moment {
    /// What it carries.
    pub kg_s: f64,
    /// Its σz as a part of that of class D.
    pub sigma_z_part: f64,
    /// How far its axis is displaced up, in σz of class D.
    pub up_sigma_z: f64,
}

/// The same with a plume of its own for each pass.
pub fn across(factor: f64, heights_agl_m: &[f64], of_pass: &dyn Fn(usize) -> Moment) -> String {
    let distance_m = 1000.0f64;
    // Briggs, class D.
    let sigma_z = 0.06 * distance_m / (1.0 + 0.0015 * distance_m).sqrt();
    let sigma_y = 0.08 * distance_m / (1.0 + 0.0001 * distance_m).sqrt();
    // International standard atmosphere below 400 m: the density of the air falls by 1 % in 100 m.
    let kg_m3 =
        |height: f64| 16.043e-3 / (8.314_462 * 288.15 / 1e5) * 1e-6 * (1.0 - 9.6e-5 * height);
    let bell = |v: f64, s: f64| (-0.5 * (v / s).powi(2)).exp();
    let mut text = String::from(
        "time_s,platform,lat_deg,lon_deg,alt_amsl_m,ch4_ppm,wind_speed_m_s,wind_from_deg\n",
    );
    for (pass, height) in heights_agl_m.iter().chain(heights_agl_m).enumerate() {
        let speed = 8.0 * (height / 150.0f64).powf(0.15);
        for k in 0..=40u32 {
            let along = -400.0 + 20.0 * f64::from(k);
            let north_m = if pass % 2 == 0 { along } else { -along };
            let moment = of_pass(pass);
            let sigma_now = moment.sigma_z_part * sigma_z;
            let c = moment.kg_s / (std::f64::consts::TAU * speed * sigma_y * sigma_now)
                * bell(north_m, sigma_y)
                * bell(height - 150.0 - sigma_z * moment.up_sigma_z, sigma_now);
            let noise = 0.01 * (f64::from((k * 7919 + 31 * pass as u32) % 101) / 50.0 - 1.0);
            let ppm = 2.0 + factor * (c / kg_m3(*height) + noise);
            // Metres of a degree at 45° on WGS84: 111131.7 north, 78846.8 east.
            let (lat, lon) = (45.0 + north_m / 111_131.7, 5.0 + distance_m / 78_846.8);
            text += &format!(
                "{},uav,{lat:.8},{lon:.8},{},{ppm:.6},{speed:.4},270\n",
                120 * pass as u32 + k,
                100.0 + height
            );
        }
    }
    text
}
