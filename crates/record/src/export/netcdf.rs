//! Trajectories in NetCDF by the CF conventions (CF-1.11, H.4.3: contiguous ragged arrays; one trajectory a vehicle).

use super::{Flown, Read};
use formats::calendar::rfc_3339;
use formats::netcdf::{Attribute, Values, Variable, file};
use plume::Gas;

const TRAJECTORY: usize = 0;
const LETTERS: usize = 1;
const READING: usize = 2;

/// The file.
pub fn trajectories(flown: &Flown) -> Vec<u8> {
    let mut sorted: Vec<&Read> = flown.readings.iter().collect();
    sorted.sort_by_key(|r| r.vehicle);
    let names: Vec<&str> = flown.vehicles.iter().map(|v| v.name.as_str()).collect();
    let letters = names.iter().map(|n| n.len()).max().unwrap_or(1).max(1);
    let dimensions = [
        ("trajectory", names.len().max(1)),
        ("name_strlen", letters),
        ("obs", sorted.len().max(1)),
    ];
    let count = |k: usize| sorted.iter().filter(|r| r.vehicle == k).count() as i32;
    let counts = (0..names.len()).map(count).collect();
    let mut variables = vec![
        Variable {
            name: "trajectory".to_owned(),
            over: vec![TRAJECTORY, LETTERS],
            attributes: vec![
                ("cf_role", "trajectory_id".into()),
                ("long_name", "vehicle".into()),
            ],
            values: Values::Char(names.iter().flat_map(|n| padded(n, letters)).collect()),
        },
        Variable {
            name: "row_size".to_owned(),
            over: vec![TRAJECTORY],
            attributes: vec![
                ("long_name", "number of readings of this vehicle".into()),
                ("sample_dimension", "obs".into()),
            ],
            values: Values::Int(counts),
        },
    ];
    let fields = fields(flown.gas);
    let kept = fields
        .iter()
        .filter(|f| sorted.iter().any(|r| (f.of)(r).is_some()));
    variables.extend(kept.map(|f| f.variable(flown, &sorted)));
    let about: [Attribute; 5] = [
        ("Conventions", "CF-1.11".into()),
        ("featureType", "trajectory".into()),
        ("title", format!("Plumage: {}", flown.name).as_str().into()),
        (
            "source",
            concat!("plumage ", env!("CARGO_PKG_VERSION")).into(),
        ),
        ("geospatial_vertical_positive", "up".into()),
    ];
    file(&dimensions, &about, &variables)
}

fn padded(name: &str, letters: usize) -> Vec<u8> {
    let mut bytes = name.as_bytes().to_vec();
    bytes.resize(letters, 0);
    bytes
}

/// What is written of a reading.
struct Field {
    name: String,
    /// Its name by the conventions, or in words where they have none.
    standard: Result<String, &'static str>,
    units: &'static str,
    of: fn(&Read) -> Option<f64>,
}

fn fields(gas: Gas) -> Vec<Field> {
    let field = |name: &str, standard: &str, units, of| Field {
        name: name.to_owned(),
        standard: Ok(standard.to_owned()),
        units,
        of,
    };
    let of_state = |name: &str, standard, units, of| Field {
        name: name.to_owned(),
        standard,
        units,
        of,
    };
    vec![
        field("time", "time", "", |r| Some(r.time_s)),
        field("lat", "latitude", "degrees_north", |r| Some(r.lat_deg)),
        field("lon", "longitude", "degrees_east", |r| Some(r.lon_deg)),
        field("alt", "altitude", "m", |r| Some(r.alt_amsl_m)),
        field(gas.as_str(), &gas.standard_name(), "1e-6", |r| r.ppm),
        field("wind_speed", "wind_speed", "m s-1", |r| r.wind_speed_m_s),
        field("wind_from", "wind_from_direction", "degree", |r| {
            r.wind_from_deg
        }),
        field("temperature", "air_temperature", "degC", |r| {
            r.temperature_c
        }),
        field("pressure", "air_pressure", "hPa", |r| r.pressure_hpa),
        of_state(
            "heading",
            Ok("platform_azimuth_angle".to_owned()),
            "degree",
            |r| r.state.as_ref().map(|s| s.heading_deg),
        ),
        of_state("roll", Ok("platform_roll".to_owned()), "degree", |r| {
            r.state.as_ref().map(|s| s.roll_deg)
        }),
        of_state("pitch", Ok("platform_pitch".to_owned()), "degree", |r| {
            r.state.as_ref().map(|s| s.pitch_deg)
        }),
        of_state("airspeed", Err("true airspeed"), "m s-1", |r| {
            r.state.as_ref().map(|s| s.airspeed_m_s)
        }),
    ]
}

impl Field {
    fn variable(&self, flown: &Flown, sorted: &[&Read]) -> Variable {
        let is_time = self.name == "time";
        // Without a start the dates of KML: what counts from nothing is no time by the conventions.
        let zero_ns = flown.start_unix_ns.unwrap_or(crate::kml::NO_START_NS);
        let units = if is_time {
            format!(
                "seconds since {}",
                rfc_3339(zero_ns).replace('T', " ").replace(".000Z", "")
            )
        } else {
            self.units.to_owned()
        };
        let mut attributes: Vec<Attribute> = vec![("units", units.as_str().into())];
        match &self.standard {
            Ok(name) => attributes.push(("standard_name", name.as_str().into())),
            Err(words) => attributes.push(("long_name", (*words).into())),
        }
        match self.name.as_str() {
            "time" => attributes.push(("calendar", "standard".into())),
            "alt" => attributes.push(("positive", "up".into())),
            "lat" | "lon" => {}
            _ => {
                attributes.push(("coordinates", "time lat lon alt".into()));
                attributes.push(("_FillValue", Values::Double(vec![f64::NAN])));
            }
        }
        let value = |r: &&Read| (self.of)(r).unwrap_or(f64::NAN);
        Variable {
            name: self.name.clone(),
            over: vec![READING],
            attributes,
            values: Values::Double(sorted.iter().map(value).collect()),
        }
    }
}
