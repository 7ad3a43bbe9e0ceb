//! Which of a log's columns become which of Plumage's, and how.

use super::clock::{self, LogClock};
use super::grid::MetricPosition;
use super::layout::Layout;
use super::vector::WindVector;
use crate::ImportError;
use crate::decode::letters;
use crate::height::{Datum, Reduction};
use crate::map::{ColumnMap, LogMap, Names};
use crate::number;
use crate::quantity::{Dimension, FLIGHT, OBSERVATION, Quantity};
use crate::unit::{Conversion, Unit};
use formats::delimited::{Cells, number as parse_number};
use plume::units::{self, Gas};
use std::collections::BTreeMap;

/// Temperature to which masses in a volume refer unless stated, °C (EU directive 2008/50/EC, annex VI).
const MASS_TEMPERATURE_C: f64 = 20.0;
/// Pressure to which they refer, hPa (the same).
const MASS_PRESSURE_HPA: f64 = 1013.0;

/// Where a column's values come from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Source {
    /// This cell of a row, from 0.
    Cell(usize),
    /// One value for all rows.
    Value(f64),
    /// Several cells of a row.
    Derived(Derived),
}

/// What is made of several cells of a row: its place in [`Vectors::of_row`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Derived {
    /// Speed of a wind in components.
    WindSpeed,
    /// Direction from which it blows.
    WindFrom,
    /// Latitude of a place in metres.
    Lat,
    /// Its longitude.
    Lon,
}

/// Vectors of which a log has the components.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Vectors {
    /// The wind.
    pub wind: Option<WindVector>,
    /// The place.
    pub position: Option<MetricPosition>,
}

impl Vectors {
    /// What a row says, in the order of [`Derived`]; NaN where it says nothing.
    pub fn of_row(&self, cells: &Cells) -> [f64; 4] {
        let nothing = (f64::NAN, f64::NAN);
        let (speed_m_s, from_deg) = self.wind.map_or(nothing, |w| w.of_row(cells));
        let (lat_deg, lon_deg) = self.position.map_or(nothing, |p| p.of_row(cells));
        [speed_m_s, from_deg, lat_deg, lon_deg]
    }

    fn cells(&self) -> impl Iterator<Item = usize> {
        let wind = self
            .wind
            .into_iter()
            .flat_map(|w| w.cells().collect::<Vec<_>>());
        wind.chain(self.position.into_iter().flat_map(|p| p.cells()))
    }
}

/// How a cell is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reads {
    /// As a number.
    Number,
    /// As degrees, minutes and seconds.
    DegreesMinutesSeconds,
    /// As degrees and minutes of NMEA.
    Nmea,
}

/// One of Plumage's columns and how its values are made.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// What it is.
    pub quantity: &'static Quantity,
    /// Where its values come from.
    pub source: Source,
    /// The cell beside it that says N, S, E or W, if there is one.
    pub side: Option<usize>,
    /// How it is read, and what was assumed of it, in words.
    pub notices: Vec<String>,
    missing: Vec<String>,
    reads: Reads,
    factor: f64,
    offset: f64,
    reduction: Option<Reduction>,
}

impl Column {
    fn new(quantity: &'static Quantity, source: Source) -> Self {
        Self {
            quantity,
            source,
            side: None,
            notices: Vec::new(),
            missing: Vec::new(),
            reads: Reads::Number,
            factor: 1.0,
            offset: 0.0,
            reduction: None,
        }
    }

    /// Whether a cell means that there is no value, by what is stated of its column.
    pub fn is_missing(&self, cell: &[u8]) -> bool {
        self.missing.iter().any(|m| m.as_bytes() == cell)
    }

    /// The value of a cell in the column's unit; none where the cell holds no number.
    pub fn value(&self, cell: &[u8], decimal_comma: bool) -> Option<f64> {
        let raw = match self.reads {
            Reads::Number => parse_number(cell, decimal_comma)?,
            Reads::DegreesMinutesSeconds => number::degrees_minutes_seconds(cell, decimal_comma)?,
            Reads::Nmea => number::nmea(cell, decimal_comma)?,
        };
        Some(self.of_number(raw))
    }

    /// A value that is made of several cells, rounded to the column's decimals.
    pub fn of_derived(&self, value: f64) -> f64 {
        number::rounded(value, self.quantity.decimals)
    }

    /// The value of a number of the log in the column's unit, rounded to its decimals where anything is converted.
    pub fn of_number(&self, raw: f64) -> f64 {
        if self.factor == 1.0
            && self.offset == 0.0
            && self.reduction.is_none()
            && self.reads == Reads::Number
        {
            return raw;
        }
        let value = raw * self.factor + self.offset;
        let value = self.reduction.map_or(value, |r| r.amsl_m(value));
        number::rounded(value, self.quantity.decimals)
    }
}

/// The rows of one platform, or of the platforms that a column names.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// The platform, where the log has a column for each sensor.
    pub platform: Option<String>,
    /// Its columns, observations before what flights have besides.
    pub columns: Vec<Column>,
    /// Vectors of which the log has the components.
    pub vectors: Vectors,
}

/// What becomes of a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// Its clock.
    pub clock: LogClock,
    /// What becomes of each row: one row, or one for each sensor.
    pub members: Vec<Member>,
    /// The cell that names the platform, if there is one.
    pub platform: Option<usize>,
    /// What was found and assumed, in words.
    pub notices: Vec<String>,
    /// What of a mapping file says the same.
    pub map: LogMap,
}

impl Plan {
    /// The columns that some member has, in order.
    pub fn quantities(&self) -> Vec<&'static Quantity> {
        let mut all: Vec<&'static Quantity> = Vec::new();
        for column in self.members.iter().flat_map(|m| &m.columns) {
            if !all.iter().any(|q| q.name == column.quantity.name) {
                all.push(column.quantity);
            }
        }
        all
    }
}

type Rows = [Cells];

/// What becomes of a log's columns, without its clock.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The columns, observations before what flights have besides.
    pub columns: Vec<Column>,
    /// Vectors of which the log has the components.
    pub vectors: Vectors,
    /// The cell that names the platform, if there is one.
    pub platform: Option<usize>,
    /// What was found and assumed, in words.
    pub notices: Vec<String>,
    /// What of a mapping file says the same.
    pub map: LogMap,
}

/// Plans what the columns of the log `name` become, by its `layout`, its first `rows` and what is stated in `map`.
///
/// # Errors
/// What cannot be told, with what to state.
pub fn columns(
    name: &str,
    layout: &Layout,
    rows: &Rows,
    map: &LogMap,
) -> Result<Planned, ImportError> {
    let mut planner = Planner {
        name,
        layout,
        rows,
        map,
        columns: Vec::new(),
        vectors: Vectors::default(),
        notices: Vec::new(),
        made: BTreeMap::new(),
    };
    planner.all()?;
    let platform = planner.platform()?;
    let map = LogMap {
        name: map.name.clone(),
        header: map.header.clone(),
        missing: map.missing.clone(),
        platform: map.platform.clone(),
        platform_column: platform.map(|c| layout.headers[c].text.clone()),
        offset_s: map.offset_s,
        undulation_m: map.undulation_m,
        qnh_hpa: map.qnh_hpa,
        base_amsl_m: map.base_amsl_m,
        mass_temperature_c: map.mass_temperature_c,
        mass_pressure_hpa: map.mass_pressure_hpa,
        wind: map.wind.clone(),
        position: map.position.clone(),
        column: planner.made,
        ..LogMap::default()
    };
    Ok(Planned {
        columns: planner.columns,
        vectors: planner.vectors,
        platform,
        notices: planner.notices,
        map,
    })
}

/// Plans how the log `name` of text is read, by its `layout`, its first `rows` and what is stated in `map`; times
/// count from `zero_s` after 1970.
///
/// # Errors
/// What is missing or cannot be told, with what to state.
pub fn plan(
    name: &str,
    layout: &Layout,
    rows: &Rows,
    map: &LogMap,
    zero_s: f64,
) -> Result<Plan, ImportError> {
    let (clock, found) = clock::find(name, layout, rows, map, zero_s)?;
    let mut notices = found.notices;
    let (mut members, mut maps, mut platform) = (Vec::new(), Vec::new(), None);
    let of_sensors = map
        .sensor
        .iter()
        .map(|s| (Some(s.platform.clone()), s.of_log(map)));
    let mut all: Vec<_> = of_sensors.collect();
    if all.is_empty() {
        all.push((None, map.clone()));
    }
    for (name_of_sensor, map) in all {
        let planned = columns(name, layout, rows, &map)?;
        let new = |n: &String| !notices.contains(n);
        let own: Vec<String> = planned.notices.into_iter().filter(new).collect();
        notices.extend(own);
        platform = planned.platform.filter(|_| name_of_sensor.is_none());
        members.push(Member {
            platform: name_of_sensor,
            columns: planned.columns,
            vectors: planned.vectors,
        });
        maps.push(planned.map);
    }
    notices.extend(unused_columns(layout, &members, &clock, platform));
    let mut planned = maps.swap_remove(0);
    if !map.sensor.is_empty() {
        planned.sensor.clone_from(&map.sensor);
        planned.column.clone_from(&map.column);
    }
    let map = LogMap {
        delimiter: Some(layout.delimiter.name()),
        decimal: Some(if layout.decimal_comma { "," } else { "." }.to_owned()),
        header_line: (layout.header_line > 0).then_some(layout.header_line),
        ..planned.over(&found.map)
    };
    Ok(Plan {
        clock,
        members,
        platform,
        notices,
        map,
    })
}

/// So many whole numbers in a row are no chance.
const WHOLE_SPEEDS: usize = 10;
/// Mean wind above which it is a gale, m/s: 8 Beaufort (WMO-No. 8, table 5.1). Few measure in it, and no small drone flies.
const GALE_M_S: f64 = 17.2;
/// Usual names of the components of a wind, without signs and units.
const COMPONENTS: [(&str, &str); 8] = [
    ("u", "v"),
    ("um", "vm"),
    ("ux", "uy"),
    ("uwind", "vwind"),
    ("windu", "windv"),
    ("windx", "windy"),
    ("uavg", "vavg"),
    ("uxavg", "uyavg"),
];

struct Planner<'a> {
    name: &'a str,
    layout: &'a Layout,
    rows: &'a Rows,
    map: &'a LogMap,
    columns: Vec<Column>,
    vectors: Vectors,
    notices: Vec<String>,
    made: BTreeMap<String, ColumnMap>,
}

impl Planner<'_> {
    fn error(&self, what: impl Into<String>, todo: impl Into<String>) -> ImportError {
        ImportError::log(self.name, what, todo)
    }

    fn header(&self, cell: usize) -> &str {
        &self.layout.headers[cell].text
    }

    fn all(&mut self) -> Result<(), ImportError> {
        for (name, stated) in &self.map.column {
            if stated.skip == Some(true) {
                self.made.insert(name.clone(), stated.clone());
            }
        }
        self.vectors()?;
        for quantity in OBSERVATION.iter().chain(FLIGHT[..23].iter()) {
            match quantity.name {
                name if self.columns.iter().any(|c| c.quantity.name == name) => {}
                "alt_amsl_m" => self.height(quantity)?,
                _ if quantity.is_gas() => {}
                _ => self.plain(quantity)?,
            }
        }
        for gas in Gas::ALL.into_iter().chain(self.other_gases()) {
            self.gas(gas)?;
        }
        self.hint_at_components();
        let order = |c: &Column| OBSERVATION.iter().position(|q| q.name == c.quantity.name);
        self.columns
            .sort_by_key(|c| order(c).unwrap_or(OBSERVATION.len()));
        Ok(())
    }

    /// Gases that only the mapping file names.
    fn other_gases(&self) -> Vec<Gas> {
        let named = self
            .map
            .column
            .keys()
            .filter_map(|name| Quantity::named(name)?.gas());
        let mut others: Vec<Gas> = named.filter(|g| matches!(g, Gas::Other(_))).collect();
        others.dedup();
        others
    }

    /// The wind and the place where they are stated as vectors.
    fn vectors(&mut self) -> Result<(), ImportError> {
        use Derived::{Lat, Lon, WindFrom, WindSpeed};
        if let Some(map) = &self.map.wind {
            let wind = WindVector::find(self.name, self.layout, map)?;
            self.notices.push(wind.words(self.layout));
            self.vectors.wind = Some(wind);
            self.derived([("wind_speed_m_s", WindSpeed), ("wind_from_deg", WindFrom)]);
        }
        if let Some(map) = &self.map.position {
            let position = MetricPosition::find(self.name, self.layout, map)?;
            self.vectors.position = Some(position);
            self.notices.push(format!(
                "lat_deg and lon_deg from \"{}\" and \"{}\", m east and north",
                map.east, map.north
            ));
            self.derived([("lat_deg", Lat), ("lon_deg", Lon)]);
        }
        Ok(())
    }

    /// Adds columns that are made of several cells; the notices so far are of the first.
    fn derived(&mut self, columns: [(&str, Derived); 2]) {
        for (name, derived) in columns {
            let Some(quantity) = Quantity::named(name) else {
                continue;
            };
            let mut column = Column::new(quantity, Source::Derived(derived));
            column.notices = std::mem::take(&mut self.notices);
            self.columns.push(column);
        }
    }

    /// Says which columns may be the components of a wind, where nothing else is its direction.
    fn hint_at_components(&mut self) {
        if self
            .columns
            .iter()
            .any(|c| c.quantity.name == "wind_from_deg")
        {
            return;
        }
        let cell = |name: &str| self.layout.headers.iter().position(|h| h.name() == name);
        let pair = COMPONENTS.iter().find_map(|(u, v)| cell(u).zip(cell(v)));
        if let Some((u, v)) = pair {
            self.notices.push(format!(
                "\"{}\" and \"{}\" look like components of the wind; [log.wind] in a mapping file states which",
                self.header(u),
                self.header(v)
            ));
        }
    }

    fn stated(&self, name: &str) -> Option<&ColumnMap> {
        self.map.column.get(name)
    }

    /// What is stated of a column's source; the inner none where nothing is.
    fn stated_source(&self, stated: &ColumnMap) -> Result<Option<Option<Source>>, ImportError> {
        if stated.skip == Some(true) {
            return Ok(Some(None));
        }
        if let Some(value) = stated.value {
            return Ok(Some(Some(Source::Value(value))));
        }
        match &stated.from {
            None => Ok(None),
            Some(Names::One(name)) => self
                .layout
                .column(self.name, name)
                .map(|cell| Some(Some(Source::Cell(cell)))),
            Some(Names::Many(names)) => {
                // One that holds nothing, or nothing but zeros, stands back behind one that reads.
                let there = || names.iter().filter_map(|n| self.layout.find_column(n));
                let reads = there().find(|c| !self.is_empty(*c) && !self.is_zero(*c));
                let cell = reads.or_else(|| there().next());
                Ok(cell.map(|cell| Some(Source::Cell(cell))))
            }
        }
    }

    /// The cell whose header names `quantity` best, with the unit that the header says.
    fn recognised(&self, quantity: &Quantity) -> Option<(usize, Option<Unit>)> {
        let headers = self.layout.headers.iter().enumerate();
        let named = headers
            .filter_map(|(cell, h)| h.quantity(quantity).map(|(rank, unit)| (rank, cell, unit)));
        let free = named.filter(|(_, cell, _)| !self.is_empty(*cell));
        free.min_by_key(|(rank, cell, _)| (self.is_zero(*cell), *rank, *cell))
            .map(|(_, cell, unit)| (cell, unit))
    }

    /// The cell of a gas: of several columns that name it one that reads rather than one of zeros, a mole fraction rather
    /// than a mass in a volume, that rather than what is in a unit that is not known, and of dry air rather than of moist
    /// air, which a plume dilutes. Says which others there are of the same kind.
    fn recognised_gas(&mut self, quantity: &Quantity) -> Option<(usize, Option<Unit>)> {
        let worth = |cell: usize, of_header: Option<Unit>| {
            let unit = self.unit(None, cell, of_header, quantity.dimension);
            match unit.map(|u| u.conversion) {
                Some(Conversion::Mass { .. }) => 2,
                Some(_) => 0,
                None if self.layout.headers[cell].bracket().is_none() => 1,
                None => 3,
            }
        };
        let headers = self.layout.headers.iter().enumerate();
        let named = headers.filter_map(|(cell, h)| h.quantity(quantity).map(|(r, u)| (cell, r, u)));
        let mut columns: Vec<_> = named
            .filter(|(cell, ..)| !self.is_empty(*cell))
            .map(|(cell, rank, unit)| {
                let wet = !self.layout.headers[cell].is_dry();
                let kind = (self.is_zero(cell), worth(cell, unit), wet);
                // All names of dry air are alike.
                ((kind, if wet { rank } else { 0 }), cell, unit)
            })
            .collect();
        columns.sort_by_key(|(worth, cell, _)| (*worth, *cell));
        let (best, cell, unit) = *columns.first()?;
        let alike = columns.iter().skip(1).filter(|(worth, ..)| *worth == best);
        let others: Vec<String> = alike
            .map(|(_, c, _)| format!("\"{}\"", self.header(*c)))
            .collect();
        if !others.is_empty() {
            self.notices.push(format!(
                "assumed: of several columns \"{}\" is used, not {} (otherwise state `from` of {} in a mapping \
                 file)",
                self.header(cell),
                others.join(", "),
                quantity.name
            ));
        }
        Some((cell, unit))
    }

    /// Whether a column holds nothing in the first rows.
    fn is_empty(&self, cell: usize) -> bool {
        !self.rows.is_empty() && self.numbers(cell, Reads::Number).is_empty() && {
            let dms = self.numbers(cell, Reads::DegreesMinutesSeconds);
            dms.is_empty()
        }
    }

    /// Whether a column is zero throughout the first rows: a sensor that is not there, or off.
    fn is_zero(&self, cell: usize) -> bool {
        let numbers = self.numbers(cell, Reads::Number);
        !numbers.is_empty() && numbers.iter().all(|v| *v == 0.0)
    }

    fn numbers(&self, cell: usize, reads: Reads) -> Vec<f64> {
        let comma = self.layout.decimal_comma;
        let cells = self.rows.iter().map(|r| r.get(cell));
        let cells = cells.filter(|c| !self.is_missing(c));
        let read = |c: &[u8]| match reads {
            Reads::Number => parse_number(c, comma),
            Reads::DegreesMinutesSeconds => number::degrees_minutes_seconds(c, comma),
            Reads::Nmea => number::nmea(c, comma),
        };
        cells.filter_map(read).collect()
    }

    fn is_missing(&self, cell: &[u8]) -> bool {
        number::is_none(cell) || self.map.missing.iter().any(|m| m.as_bytes() == cell)
    }

    /// The middle one of a column's first values.
    fn middle(&self, cell: usize) -> Option<f64> {
        let mut values = self.numbers(cell, Reads::Number);
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    }

    /// The unit of a cell: as stated, by its header, by the row of units, or none.
    fn unit(
        &self,
        stated: Option<&ColumnMap>,
        cell: usize,
        of_header: Option<Unit>,
        d: Dimension,
    ) -> Option<Unit> {
        let by_map = stated.and_then(|s| s.unit.as_deref());
        let in_brackets = || self.layout.headers[cell].bracket();
        let by_brackets = || in_brackets().and_then(|u| Unit::parse(d, u));
        let by_row = || self.layout.units.get(cell).and_then(|u| Unit::parse(d, u));
        by_map
            .and_then(|u| Unit::parse(d, u))
            .or(of_header)
            .or_else(by_brackets)
            .or_else(by_row)
    }

    /// A quantity that is neither a gas nor the height.
    fn plain(&mut self, quantity: &'static Quantity) -> Result<(), ImportError> {
        let stated = self.stated(quantity.name).cloned();
        let source = match &stated {
            Some(s) => self.stated_source(s)?,
            None => None,
        };
        let (source, of_header) = match source {
            Some(None) => return Ok(()),
            Some(Some(Source::Cell(cell))) => {
                let unit = self.layout.headers[cell].quantity(quantity);
                (Source::Cell(cell), unit.and_then(|(_, unit)| unit))
            }
            Some(Some(value)) => (value, None),
            None => match self.recognised(quantity) {
                Some((cell, unit)) => (Source::Cell(cell), unit),
                None => return Ok(()),
            },
        };
        let unit = match source {
            Source::Value(_) | Source::Derived(_) => Unit::own(quantity.dimension),
            Source::Cell(cell) => {
                let unit = self.unit(stated.as_ref(), cell, of_header, quantity.dimension);
                unit.unwrap_or_else(|| self.assumed_unit(quantity, cell))
            }
        };
        self.add(quantity, source, unit, stated.as_ref(), None)
    }

    /// The unit of a column that none is stated of, by the size of its values.
    fn assumed_unit(&mut self, quantity: &Quantity, cell: usize) -> Unit {
        let dimension = quantity.dimension;
        let middle = self.middle(cell);
        let named = |name: &str| Unit::parse(dimension, name);
        let by_size = match (dimension, middle) {
            // No air is at 150 °C, and none at 150 K.
            (Dimension::Temperature, Some(v)) if v > 150.0 => named("K"),
            // The air at the ground has 500 to 1100 hPa.
            (Dimension::Pressure, Some(v)) if v > 11_000.0 => named("Pa"),
            (Dimension::Pressure, Some(v)) if (30.0..150.0).contains(&v) => named("kPa"),
            // Of one a share is all there is; a percentage is hardly ever that small.
            (Dimension::Share, Some(v)) if v.abs() > 1.5 => named("%"),
            (Dimension::Place, None) => named("dms"),
            (Dimension::Place, Some(v)) if v.abs() > 1e6 => named("1e-7 deg"),
            (Dimension::Place, Some(v)) if v.abs() > 180.0 => named("ddmm.mmmm"),
            _ => None,
        };
        let unit = by_size.unwrap_or_else(|| Unit::own(dimension));
        if dimension != Dimension::Place || by_size.is_some() {
            let in_doubt = match quantity.name {
                "wind_speed_m_s" => self.speed_in_doubt(cell),
                _ => "",
            };
            self.notices.push(format!(
                "assumed: \"{}\" states no unit and is read in {}{in_doubt}",
                self.header(cell),
                unit.name
            ));
        }
        unit
    }

    /// Why a speed without a unit may not be in m/s, as the end of a notice: whole numbers, as stations report knots and
    /// km/h, or a gale in the middle.
    fn speed_in_doubt(&self, cell: usize) -> &'static str {
        let speeds = self.numbers(cell, Reads::Number);
        let is_whole = speeds.len() >= WHOLE_SPEEDS && speeds.iter().all(|v| v.fract() == 0.0);
        if is_whole && speeds.iter().any(|v| *v != speeds[0]) {
            return "; all its values are whole numbers, as those of stations that report knots or km/h: if so, state \
                    unit = \"knots\" of wind_speed_m_s in a mapping file";
        }
        if self.middle(cell).is_some_and(|v| v > GALE_M_S) {
            return "; its median is that of a gale: if it is in knots or km/h, state unit = \"knots\" of \
                    wind_speed_m_s in a mapping file";
        }
        ""
    }

    /// A gas: in ppb where the log has it so, but for CO2.
    fn gas(&mut self, gas: Gas) -> Result<(), ImportError> {
        let of = |unit| Quantity::named(gas.column(unit));
        let (Some(ppm), Some(ppb)) = (of(units::Unit::Ppm), of(units::Unit::Ppb)) else {
            return Ok(());
        };
        for quantity in [ppm, ppb] {
            let Some(stated) = self.stated(quantity.name).cloned() else {
                continue;
            };
            match self.stated_source(&stated)? {
                Some(None) => return Ok(()),
                Some(Some(Source::Cell(cell))) => {
                    let of_header = self.layout.headers[cell].quantity(ppm).and_then(|(_, u)| u);
                    return self.gas_in(quantity, cell, of_header, Some(&stated));
                }
                // A gas is never made of several cells.
                Some(Some(value)) => {
                    let unit = Unit::own(quantity.dimension);
                    return self.add(quantity, value, unit, Some(&stated), None);
                }
                None => {
                    if let Some((cell, of_header)) = self.recognised(ppm) {
                        return self.gas_in(quantity, cell, of_header, Some(&stated));
                    }
                }
            }
        }
        let Some((cell, of_header)) = self.recognised_gas(ppm) else {
            return Ok(());
        };
        let unit = self.unit(None, cell, of_header, ppm.dimension);
        let in_ppb = unit.is_some_and(|u| ["ppb", "ppt", "ug/m3"].contains(&u.name));
        let by_size =
            unit.is_none() && gas == Gas::Ch4 && self.middle(cell).is_some_and(|v| v > 1000.0);
        let quantity = if (in_ppb || by_size) && gas != Gas::Co2 {
            ppb
        } else {
            ppm
        };
        self.gas_in(quantity, cell, of_header, None)
    }

    fn gas_in(
        &mut self,
        quantity: &'static Quantity,
        cell: usize,
        of_header: Option<Unit>,
        stated: Option<&ColumnMap>,
    ) -> Result<(), ImportError> {
        let of_header = of_header.and_then(|u| Unit::parse(quantity.dimension, u.name));
        let unit = match self.unit(stated, cell, of_header, quantity.dimension) {
            Some(unit) => unit,
            None => self.assumed_gas_unit(quantity, cell)?,
        };
        self.add(quantity, Source::Cell(cell), unit, stated, None)
    }

    /// The unit of a gas that none is stated of: by the size of what is in all air, for CO2 and CH4 only.
    fn assumed_gas_unit(&mut self, quantity: &Quantity, cell: usize) -> Result<Unit, ImportError> {
        let middle = self.middle(cell).unwrap_or(f64::NAN);
        // All air has 400 ppm of CO2 and 1.9 ppm of CH4, whatever a plume adds.
        let name = match quantity.gas() {
            Some(Gas::Co2) if (300.0..20_000.0).contains(&middle) => Some("ppm"),
            Some(Gas::Co2) if (0.03..2.0).contains(&middle) => Some("%"),
            Some(Gas::Ch4) if (1.5..100.0).contains(&middle) => Some("ppm"),
            Some(Gas::Ch4) if (1500.0..100_000.0).contains(&middle) => Some("ppb"),
            _ => None,
        };
        let header = self.header(cell).to_owned();
        // What stands in brackets is a unit that is not known (mV), or no unit: then size tells nothing.
        let name = name.filter(|_| self.layout.headers[cell].bracket().is_none());
        let unit = name.and_then(|n| Unit::parse(quantity.dimension, n));
        let gas = quantity.gas().map_or("", Gas::as_str);
        let unit = unit.ok_or_else(|| {
            self.error(
                format!("column \"{header}\": the unit of {gas} is unknown"),
                format!(
                    "state it in a mapping file (--map): [[log]] and below it [log.column.{gas}_ppb] with \
                     from = \"{header}\" and unit = \"ppb\" (or ppm, %, ug/m3, mg/m3), or skip = true"
                ),
            )
        })?;
        self.notices.push(format!(
            "assumed: \"{header}\" states no unit and is read in {}, judged by the value {:.6} (air has 400 ppm \
             of CO2 and 1.9 ppm of CH4)",
            unit.name,
            middle
        ));
        Ok(unit)
    }

    /// The height: as stated, else above mean sea level, else what the statements suffice for.
    fn height(&mut self, quantity: &'static Quantity) -> Result<(), ImportError> {
        let stated = self.stated(quantity.name).cloned().unwrap_or_default();
        match self.stated_source(&stated)? {
            Some(None) => return Ok(()),
            Some(Some(value @ (Source::Value(_) | Source::Derived(_)))) => {
                let unit = Unit::own(quantity.dimension);
                return self.add(quantity, value, unit, Some(&stated), None);
            }
            Some(Some(Source::Cell(cell))) => {
                let known = self.layout.headers[cell].height();
                let datum = stated
                    .datum
                    .or(known.map(|(datum, ..)| datum))
                    .unwrap_or(Datum::Amsl);
                let clear = stated.datum.is_some() || known.is_some_and(|(_, clear, _)| clear);
                let of_header = known.and_then(|(_, _, unit)| unit);
                return self.height_in(quantity, (cell, datum, clear, of_header), &stated);
            }
            None => {}
        }
        let headers = self.layout.headers.iter().enumerate();
        let heights: Vec<(usize, Datum, bool, Option<Unit>)> = headers
            .filter_map(|(cell, h)| {
                h.height()
                    .map(|(datum, clear, unit)| (cell, datum, clear, unit))
            })
            .filter(|(cell, ..)| !self.is_empty(*cell))
            .collect();
        let by_map = self.map.heights();
        let wanted = |(_, datum, ..): &&(usize, Datum, bool, Option<Unit>)| {
            stated.datum.is_none_or(|s| s == *datum)
        };
        let worth = |(cell, datum, clear, _): &&(usize, Datum, bool, Option<Unit>)| {
            let usable = datum.reduction(&by_map).is_ok();
            let needs = *datum != Datum::Amsl;
            // Above the sea as it says; of what a statement was made for; above the sea as may be.
            (!usable, if *clear { usize::from(needs) } else { 2 }, *cell)
        };
        if let Some(best) = heights.iter().filter(wanted).min_by_key(worth) {
            return self.height_in(quantity, *best, &stated);
        }
        // Of a log without heights the pressure tells them, if it is stated what it is at the sea.
        let pressure = by_map.qnh_hpa.and(Quantity::named("pressure_hpa"));
        match pressure.and_then(|p| self.recognised(p)) {
            Some((cell, unit)) => {
                self.height_in(quantity, (cell, Datum::Pressure, true, unit), &stated)
            }
            None => Ok(()),
        }
    }

    fn height_in(
        &mut self,
        quantity: &'static Quantity,
        (cell, datum, clear, of_header): (usize, Datum, bool, Option<Unit>),
        stated: &ColumnMap,
    ) -> Result<(), ImportError> {
        let header = self.header(cell).to_owned();
        let reduction = datum
            .reduction(&self.map.heights())
            .map_err(|(key, what)| {
                let option = key.replace('_', "-");
                self.error(
                    format!(
                        "column \"{header}\": contains heights {}; no column has heights above mean sea level",
                        datum.words()
                    ),
                    format!("state --{option}: {what}"),
                )
            })?;
        let dimension = match datum {
            Datum::Pressure => Dimension::Pressure,
            _ => quantity.dimension,
        };
        let unit = match self.unit(Some(stated), cell, of_header, dimension) {
            Some(unit) => unit,
            None => {
                let unit = Unit::own(dimension);
                self.notices.push(format!(
                    "assumed: \"{header}\" states no unit and is read in {}",
                    unit.name
                ));
                unit
            }
        };
        if !clear {
            self.notices.push(format!(
                "assumed: \"{header}\" states no datum and is read as above mean sea level (otherwise state the \
                 datum of alt_amsl_m in a mapping file)"
            ));
        }
        let stated = ColumnMap {
            datum: Some(datum),
            ..stated.clone()
        };
        let reduction = (datum != Datum::Amsl).then_some(reduction);
        self.add(quantity, Source::Cell(cell), unit, Some(&stated), reduction)
    }

    fn add(
        &mut self,
        quantity: &'static Quantity,
        source: Source,
        unit: Unit,
        stated: Option<&ColumnMap>,
        reduction: Option<Reduction>,
    ) -> Result<(), ImportError> {
        let mut column = Column::new(quantity, source);
        column.reduction = reduction;
        column.side = self.side(quantity, source);
        column.missing = stated.map_or_else(Vec::new, |s| s.missing.clone());
        let (factor, offset) = match unit.conversion {
            Conversion::Linear { factor, offset } => (factor, offset),
            Conversion::Mass { kg_m3 } => (self.of_mass(quantity, kg_m3, source)?, 0.0),
            Conversion::DegreesMinutesSeconds => {
                column.reads = Reads::DegreesMinutesSeconds;
                (1.0, 0.0)
            }
            Conversion::Nmea => {
                column.reads = Reads::Nmea;
                (1.0, 0.0)
            }
        };
        let (scale, before) = stated.map_or((1.0, 0.0), |s| {
            (s.scale.unwrap_or(1.0), s.offset.unwrap_or(0.0))
        });
        column.factor = scale * factor;
        column.offset = before * factor + offset;
        let (datum, from, value) = (
            stated.and_then(|s| s.datum),
            match source {
                Source::Cell(cell) => Some(Names::One(self.header(cell).to_owned())),
                Source::Value(_) | Source::Derived(_) => None,
            },
            match source {
                Source::Cell(_) | Source::Derived(_) => None,
                Source::Value(value) => Some(value),
            },
        );
        let counted = datum.filter(|d| *d != Datum::Amsl);
        // Notices since the last column are of this one.
        column.notices = std::mem::take(&mut self.notices);
        column.notices.push(match (source, counted) {
            (Source::Value(value), _) => {
                format!("{} is {value} in all rows, as stated", quantity.name)
            }
            (Source::Derived(_), _) => format!("{} from several columns", quantity.name),
            (Source::Cell(cell), None) => {
                format!(
                    "{} from \"{}\" in {}",
                    quantity.name,
                    self.header(cell),
                    unit.name
                )
            }
            (Source::Cell(cell), Some(datum)) => format!(
                "{} from \"{}\" in {}, {}, converted as stated",
                quantity.name,
                self.header(cell),
                unit.name,
                datum.words()
            ),
        });
        let made = ColumnMap {
            from,
            value,
            unit: value.is_none().then(|| unit.name.to_owned()),
            scale: stated.and_then(|s| s.scale),
            offset: stated.and_then(|s| s.offset),
            datum,
            missing: column.missing.clone(),
            skip: None,
        };
        self.made.insert(quantity.name.to_owned(), made);
        self.columns.push(column);
        Ok(())
    }

    /// The column beside a latitude or longitude that says its side, as in logs of NMEA sentences.
    fn side(&self, quantity: &Quantity, source: Source) -> Option<usize> {
        let (Dimension::Place, Source::Cell(cell)) = (quantity.dimension, source) else {
            return None;
        };
        let cells = self.rows.iter().map(|r| r.get(cell + 1));
        let mut letters = cells.filter(|c| !c.is_empty()).peekable();
        letters.peek()?;
        let is_side = |c: &[u8]| matches!(c, [b'N' | b'S' | b'E' | b'W']);
        letters.all(is_side).then_some(cell + 1)
    }

    /// Mole fraction in the column's unit of one unit of mass in a volume.
    fn of_mass(
        &mut self,
        quantity: &Quantity,
        kg_m3: f64,
        source: Source,
    ) -> Result<f64, ImportError> {
        let Dimension::Gas {
            gas: Some(gas),
            unit,
        } = quantity.dimension
        else {
            return Err(self.error(
                format!(
                    "{} as a mass concentration, without the name of the gas",
                    quantity.name
                ),
                "state it in ppm, ppb or %, or skip = true",
            ));
        };
        if gas.molar_mass_kg_mol().is_nan() {
            return Err(self.error(
                format!(
                    "{} as a mass concentration: the molar mass of {} is unknown",
                    quantity.name,
                    gas.as_str()
                ),
                "convert it to ppm or ppb before",
            ));
        }
        let temperature_c = self.map.mass_temperature_c.unwrap_or(MASS_TEMPERATURE_C);
        let pressure_hpa = self.map.mass_pressure_hpa.unwrap_or(MASS_PRESSURE_HPA);
        let air = air::isa::Air {
            temperature_k: temperature_c + air::isa::ZERO_CELSIUS_K,
            pressure_pa: pressure_hpa * 100.0,
        };
        let header = match source {
            Source::Cell(cell) => self.header(cell),
            Source::Value(_) | Source::Derived(_) => quantity.name,
        };
        let is_stated =
            self.map.mass_temperature_c.is_some() && self.map.mass_pressure_hpa.is_some();
        let notices = format!(
            "{}\"{header}\" is a mass concentration in air at {temperature_c} °C and {pressure_hpa} hPa",
            if is_stated { "" } else { "assumed: " }
        );
        self.notices.push(notices);
        Ok(gas.ppm(kg_m3, air) * unit.per_ppm())
    }

    fn platform(&mut self) -> Result<Option<usize>, ImportError> {
        if let Some(name) = &self.map.platform_column {
            return self.layout.column(self.name, name).map(Some);
        }
        if self.map.platform.is_some() {
            return Ok(None);
        }
        let known = self
            .layout
            .headers
            .iter()
            .position(crate::recognise::Header::is_platform);
        if let Some(cell) = known {
            self.notices
                .push(format!("platform from \"{}\"", self.header(cell)));
        }
        Ok(known)
    }
}

/// A notice that lists the columns that are not used.
fn unused_columns(
    layout: &Layout,
    members: &[Member],
    clock: &LogClock,
    platform: Option<usize>,
) -> Option<String> {
    let columns = || members.iter().flat_map(|m| &m.columns);
    let cells = columns().filter_map(|c| match c.source {
        Source::Cell(cell) => Some(cell),
        Source::Value(_) | Source::Derived(_) => None,
    });
    let sides = columns().filter_map(|c| c.side);
    let mut used: Vec<usize> = cells.chain(sides).chain(platform).collect();
    used.extend(members.iter().flat_map(|m| m.vectors.cells()));
    match &clock.cells {
        clock::TimeCells::Stamp(c)
        | clock::TimeCells::OfDay(c)
        | clock::TimeCells::Count(c, _, None) => used.push(*c),
        clock::TimeCells::DateAndTime(a, b) | clock::TimeCells::Count(a, _, Some(b)) => {
            used.extend([*a, *b])
        }
        clock::TimeCells::Parts(all) => used.extend(all),
    }
    let headers = layout.headers.iter().enumerate();
    let left: Vec<&str> = headers
        .filter(|(cell, header)| !used.contains(cell) && !header.text.is_empty())
        .map(|(_, header)| header.text.as_str())
        .collect();
    (!left.is_empty()).then(|| format!("not used: {}", left.join(", ")))
}

/// A cell's text, for messages.
pub fn shown(cell: &[u8]) -> String {
    letters(cell).chars().take(40).collect()
}
