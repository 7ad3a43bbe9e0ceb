//! What Plumage's observation and flight files hold, and what other people call it.

use plume::units::{Gas, Unit};
use std::sync::{Mutex, PoisonError};

/// What kind of number a quantity is: which units it may have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Dimension {
    /// Latitude or longitude, °.
    Place,
    /// Height or distance, m.
    Length,
    /// Speed, m/s.
    Speed,
    /// Direction or angle, °.
    Angle,
    /// Temperature, °C.
    Temperature,
    /// Share in hundred, %.
    Percent,
    /// Pressure, hPa.
    Pressure,
    /// Mole fraction.
    Gas {
        /// Of which gas; none where it is that of another column.
        gas: Option<Gas>,
        /// Unit of the column.
        unit: Unit,
    },
    /// Angular rate, °/s.
    Rate,
    /// Acceleration, m/s².
    Acceleration,
    /// Share of one.
    Share,
    /// Time, s.
    Duration,
}

/// A column of Plumage's files.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Its name there, with the unit.
    pub name: &'static str,
    /// What kind of number it is.
    pub dimension: Dimension,
    /// Decimals to which converted values are written.
    pub decimals: u8,
    /// Other people's names for it: small letters and digits only, without the unit, separated by blanks.
    pub(crate) aliases: &'static str,
}

const fn quantity(
    name: &'static str,
    dimension: Dimension,
    decimals: u8,
    aliases: &'static str,
) -> Quantity {
    Quantity {
        name,
        dimension,
        decimals,
        aliases,
    }
}

const fn ppm(gas: Gas, aliases: &'static str) -> Quantity {
    mole_fraction(gas, Unit::Ppm, 9, aliases)
}

const fn ppb(gas: Gas) -> Quantity {
    mole_fraction(gas, Unit::Ppb, 6, "")
}

const fn mole_fraction(gas: Gas, unit: Unit, decimals: u8, aliases: &'static str) -> Quantity {
    let dimension = Dimension::Gas {
        gas: Some(gas),
        unit,
    };
    quantity(gas.column(unit), dimension, decimals, aliases)
}

use Dimension::{
    Acceleration, Angle, Duration, Length, Percent, Place, Pressure, Rate, Share, Speed,
    Temperature,
};

/// Columns of observations, in the order in which they are written. Time and platform stand before them.
pub const OBSERVATION: [Quantity; 39] = [
    quantity(
        "lat_deg",
        Place,
        9,
        "lat latitude breite breitengrad latitud latdd latdeg ylat gpsabslat osdlatitude 纬度",
    ),
    quantity(
        "lon_deg",
        Place,
        9,
        "lon long lng longitude länge laenge längengrad laengengrad longitud londd xlon gpsabslong \
        gpsabslon osdlongitude 经度",
    ),
    quantity(
        "alt_amsl_m",
        Length,
        4,
        "altamsl höheübernn hoeheuebernn höheübernhn alt altitude elevation elev ele altmsl mslalt \
        msl altitudemsl altitudeamsl amsl altitudeabovesealevel heightamsl heightmsl altitudeasl \
        altasl masl hmsl zamsl 海拔高度 海拔",
    ),
    ppm(
        Gas::Co2,
        "co2 carbondioxide carbondioxideco2 co2mixingratio xco2 co2dry co2conc co2concentration \
        co2molefraction co2d",
    ),
    ppb(Gas::Co2),
    ppm(
        Gas::Ch4,
        "ch4 methane methanech4 ch4mixingratio xch4 ch4dry ch4conc ch4concentration ch4molefraction ch4d",
    ),
    ppb(Gas::Ch4),
    ppm(
        Gas::So2,
        "so2 sulfurdioxide sulfurdioxideso2 so2mixingratio sulphurdioxide so2conc so2concentration",
    ),
    ppb(Gas::So2),
    ppm(
        Gas::Co,
        "co carbonmonoxide carbonmonoxideco codry coconc coconcentration cod",
    ),
    ppb(Gas::Co),
    ppm(
        Gas::No2,
        "no2 nitrogendioxide nitrogendioxideno2 no2conc no2concentration",
    ),
    ppb(Gas::No2),
    ppm(
        Gas::Nh3,
        "nh3 ammonia ammonianh3 nh3dry nh3conc nh3concentration",
    ),
    ppb(Gas::Nh3),
    ppm(
        Gas::H2s,
        "h2s hydrogensulfide hydrogensulfideh2s hydrogensulphide h2sconc h2sconcentration",
    ),
    ppb(Gas::H2s),
    ppm(
        Gas::Sf6,
        "sf6 sulfurhexafluoride sulphurhexafluoride sf6conc",
    ),
    ppb(Gas::Sf6),
    ppm(
        Gas::N2o,
        "n2o nitrousoxide n2odry n2oconc n2oconcentration n2od",
    ),
    ppb(Gas::N2o),
    ppm(Gas::C2h6, "c2h6 ethane c2h6dry c2h6conc c2h6concentration"),
    ppb(Gas::C2h6),
    ppm(
        Gas::C2h2,
        "c2h2 acetylene ethyne c2h2dry c2h2conc c2h2concentration",
    ),
    ppb(Gas::C2h2),
    ppm(
        Gas::Hcl,
        "hcl hydrogenchloride hcldry hclconc hclconcentration",
    ),
    ppb(Gas::Hcl),
    ppm(Gas::H2, "h2 hydrogen h2dry h2conc h2concentration"),
    ppb(Gas::H2),
    quantity(
        "wind_speed_m_s",
        Speed,
        4,
        "windspeed windgeschwindigkeit ws wspd windspd wndspd windvel windvelocity windspeedscalar \
        wswvt wsmsswvt wsmphswvt metspd",
    ),
    quantity(
        "wind_from_deg",
        Angle,
        3,
        "winddir windrichtung winddirection windfrom wd wdir wdirdeg winddirectionfrom wnddir \
        windbearing winddird1wvt winddird1 wdtrue winddirtrue metdir",
    ),
    quantity(
        "temperature_c",
        Temperature,
        4,
        "temperature temperatur lufttemperatur temperatura temp airtemperature airtemp tair ta \
        ambienttemperature ambienttemp atmp airt airtc t2m outsidetemperature oat 温度",
    ),
    quantity(
        "relative_humidity_pct",
        Percent,
        4,
        "relativehumidity luftfeuchte luftfeuchtigkeit humedad rh humidity relhum relhumidity hum 湿度",
    ),
    quantity(
        "pressure_hpa",
        Pressure,
        5,
        "pressure luftdruck druck press airpressure baro bp barometricpressure atmosphericpressure \
        baropressure pres patm ambientpressure ambientpress staticpressure bpavg baropress pair 气压",
    ),
    quantity(
        "sd_ppm",
        Dimension::Gas {
            gas: None,
            unit: Unit::Ppm,
        },
        6,
        "sd",
    ),
    quantity("averaging_s", Duration, 3, "averaging averagingtime"),
    quantity("lat2_deg", Place, 9, "lat2 latitude2"),
    quantity("lon2_deg", Place, 9, "lon2 longitude2"),
    quantity("alt2_amsl_m", Length, 4, "alt2amsl"),
];

/// Columns of flights, in the order in which they are written. Time stands before them.
pub const FLIGHT: [Quantity; 25] = [
    quantity(
        "airspeed_m_s",
        Speed,
        4,
        "airspeed aspd tas ias trueairspeed trueairspeedms",
    ),
    quantity("angle_of_attack_deg", Angle, 4, "angleofattack aoa alpha"),
    quantity("sideslip_deg", Angle, 4, "sideslip ssa beta aos"),
    quantity("roll_deg", Angle, 4, "roll phi rollangle osdroll"),
    quantity("pitch_deg", Angle, 4, "pitch theta pitchangle osdpitch"),
    quantity(
        "yaw_deg",
        Angle,
        4,
        "yaw psi heading compassheading osdyaw hdg",
    ),
    quantity(
        "roll_rate_deg_s",
        Rate,
        4,
        "rollrate rollspeed p gyrx gyrox",
    ),
    quantity(
        "pitch_rate_deg_s",
        Rate,
        4,
        "pitchrate pitchspeed q gyry gyroy",
    ),
    quantity("yaw_rate_deg_s", Rate, 4, "yawrate yawspeed r gyrz gyroz"),
    quantity("accel_x_m_s2", Acceleration, 5, "accelx accx ax"),
    quantity("accel_y_m_s2", Acceleration, 5, "accely accy ay"),
    quantity("accel_z_m_s2", Acceleration, 5, "accelz accz az"),
    quantity("elevator_deg", Angle, 4, "elevator"),
    quantity("aileron_left_deg", Angle, 4, "aileronleft leftaileron"),
    quantity("aileron_right_deg", Angle, 4, "aileronright rightaileron"),
    quantity("rudder_deg", Angle, 4, "rudder"),
    quantity("elevon_left_deg", Angle, 4, "elevonleft leftelevon"),
    quantity("elevon_right_deg", Angle, 4, "elevonright rightelevon"),
    quantity("throttle", Share, 5, "throttle thr"),
    quantity(
        "vel_north_m_s",
        Speed,
        4,
        "velnorth vn velocitynorth northvelocity",
    ),
    quantity(
        "vel_east_m_s",
        Speed,
        4,
        "veleast ve velocityeast eastvelocity",
    ),
    quantity("vel_down_m_s", Speed, 4, "veldown vd velocitydown"),
    quantity("baro_height_m", Length, 4, "baroheight baroalt"),
    OBSERVATION[29],
    OBSERVATION[30],
];

/// The mole fraction of a gas that the table does not have. Each is made once and lives as long as the program, as those
/// of the table do.
fn of_other_gas(name: &str) -> Option<&'static Quantity> {
    static KNOWN: Mutex<Vec<&'static Quantity>> = Mutex::new(Vec::new());
    let (gas, unit) = match name.rsplit_once('_')? {
        ("sd", _) => return None,
        (gas, "ppm") => (gas, Unit::Ppm),
        (gas, "ppb") => (gas, Unit::Ppb),
        _ => return None,
    };
    let gas = Gas::other(gas, f64::NAN).filter(|g| g.column(unit) == name)?;
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(quantity) = known.iter().find(|q| q.name == name) {
        return Some(quantity);
    }
    let quantity: &'static Quantity = Box::leak(Box::new(match unit {
        Unit::Ppm => ppm(gas, ""),
        Unit::Ppb => ppb(gas),
    }));
    known.push(quantity);
    Some(quantity)
}

impl Quantity {
    /// The quantity of a column of Plumage's files, also of a gas that its table does not have (`xyz_ppm`); none where there
    /// is no such.
    pub fn named(name: &str) -> Option<&'static Self> {
        let mut known = OBSERVATION.iter().chain(FLIGHT.iter());
        known
            .find(|q| q.name == name)
            .or_else(|| of_other_gas(name))
    }

    /// Whether it is a gas that a platform reads.
    pub fn is_gas(&self) -> bool {
        self.gas().is_some()
    }

    /// The gas; none where it is none.
    pub fn gas(&self) -> Option<Gas> {
        match self.dimension {
            Dimension::Gas { gas, .. } => gas,
            _ => None,
        }
    }
}
