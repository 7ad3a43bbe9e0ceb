//! The wind of a log that has it as components, of the earth or of the platform that measured it.

use super::layout::Layout;
use crate::ImportError;
use crate::map::WindMap;
use crate::quantity::Dimension;
use crate::unit::{Conversion, Unit};
use formats::delimited::{Cells, number};

/// A component: the cell, and its factor to m/s (or degrees).
type Component = (usize, f64);

/// How components become a wind.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindVector {
    /// Towards east and north, or towards the right and the front of the platform.
    towards: [Component; 2],
    /// The platform's heading, where the components are its own.
    yaw: Option<Component>,
    /// The platform's velocity towards east and north, where the wind was measured against it.
    velocity: Option<[Component; 2]>,
    decimal_comma: bool,
}

impl WindVector {
    /// The wind of the log `name` as `map` states its components.
    ///
    /// # Errors
    /// Components that do not make a wind, or a column that there is not.
    pub fn find(name: &str, layout: &Layout, map: &WindMap) -> Result<Self, ImportError> {
        let finder = Finder { name, layout, map };
        let pair = |a: &Option<String>, b: &Option<String>, words: &str| match (a, b) {
            (Some(a), Some(b)) => Ok(Some([finder.speed(a)?, finder.speed(b)?])),
            (None, None) => Ok(None),
            _ => Err(finder.error(&format!("{words}: one of two"), "state both")),
        };
        let of_earth = pair(&map.east, &map.north, "east, north")?;
        let of_platform = pair(&map.right, &map.forward, "right, forward")?;
        let velocity = pair(&map.vel_east, &map.vel_north, "vel_east, vel_north")?;
        let yaw = map
            .yaw
            .as_ref()
            .map(|y| finder.component(y, Dimension::Angle, None));
        let yaw = yaw.transpose()?;
        let towards = match (of_earth, of_platform, yaw) {
            (Some(towards), None, None) | (None, Some(towards), Some(_)) => towards,
            _ => {
                return Err(finder.error(
                    "the components of the wind are not clear",
                    "state east and north, or right, forward and yaw of the platform",
                ));
            }
        };
        Ok(Self {
            towards,
            yaw,
            velocity,
            decimal_comma: layout.decimal_comma,
        })
    }

    /// Speed, m/s, and direction from which it blows, degrees, of a row's wind; NaN where a component is missing.
    pub fn of_row(&self, cells: &Cells) -> (f64, f64) {
        let value = |(cell, factor): Component| {
            number(cells.get(cell), self.decimal_comma).map_or(f64::NAN, |v| v * factor)
        };
        let [mut east, mut north] = self.towards.map(value);
        if let Some(yaw) = self.yaw {
            let (sin, cos) = value(yaw).to_radians().sin_cos();
            (east, north) = (north * sin + east * cos, north * cos - east * sin);
        }
        if let Some(velocity) = self.velocity {
            let [own_east, own_north] = velocity.map(value);
            (east, north) = (east + own_east, north + own_north);
        }
        let from_deg = match east.is_finite() && north.is_finite() {
            true => air::wind::from_deg(east, north),
            false => f64::NAN,
        };
        (east.hypot(north), from_deg)
    }

    /// The cells that it reads.
    pub fn cells(&self) -> impl Iterator<Item = usize> {
        let velocity = self.velocity.into_iter().flatten();
        let all = self.towards.into_iter().chain(self.yaw).chain(velocity);
        all.map(|(cell, _)| cell)
    }

    /// What it does, in words.
    pub fn words(&self, layout: &Layout) -> String {
        let name = |(cell, _): Component| format!("\"{}\"", layout.headers[cell].text);
        let [east, north] = self.towards.map(name);
        let frame = match self.yaw {
            None => format!("{east} towards east and {north} towards north"),
            Some(yaw) => format!(
                "{east} to the right and {north} to the front of the platform, turned by its heading {}",
                name(yaw)
            ),
        };
        let own = self.velocity.map(|v| v.map(name).join(" and "));
        let own = own.map_or(String::new(), |v| {
            format!(", with its own velocity {v} added")
        });
        format!("the wind is from {frame}{own}")
    }
}

struct Finder<'a> {
    name: &'a str,
    layout: &'a Layout,
    map: &'a WindMap,
}

impl Finder<'_> {
    fn error(&self, what: &str, todo: &str) -> ImportError {
        ImportError::log(self.name, format!("[log.wind]: {what}"), todo)
    }

    fn speed(&self, column: &str) -> Result<Component, ImportError> {
        self.component(column, Dimension::Speed, self.map.unit.as_deref())
    }

    /// The component that is called `column`, behind a minus sign with the other sign; in the unit that is stated, that its
    /// header names, or the usual one.
    fn component(
        &self,
        column: &str,
        dimension: Dimension,
        stated: Option<&str>,
    ) -> Result<Component, ImportError> {
        let exact = self.layout.headers.iter().any(|h| h.is(column));
        let (sign, column) = match column.strip_prefix('-') {
            Some(rest) if !exact => (-1.0, rest),
            _ => (1.0, column),
        };
        let cell = self.layout.column(self.name, column)?;
        let by_row = self.layout.units.get(cell).map(String::as_str);
        let unit = [stated, self.layout.headers[cell].bracket(), by_row]
            .into_iter()
            .flatten()
            .find_map(|text| Unit::parse(dimension, text));
        match unit.unwrap_or_else(|| Unit::own(dimension)).conversion {
            Conversion::Linear { factor, .. } => Ok((cell, sign * factor)),
            _ => Err(self.error(column, "state a column of numbers")),
        }
    }
}
