//! The fence that a ground station has uploaded: polygons and circles to stay in or out of.

use air::geo::{Enu, Geodetic, LocalFrame};
use mav_bridge::dialect::{MISSION_ITEM_INT_DATA as Item, MavCmd};
use protocol::SimTime;

/// Places by latitude and longitude in 1e-7 degrees, as they were uploaded.
type Place = (i32, i32);

/// A vehicle outside its fence.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Breach {
    pub since: SimTime,
    /// How often it has left the fence.
    pub count: u16,
    pub outside: bool,
}

/// One border.
#[derive(Debug, Clone, PartialEq)]
enum Border {
    Polygon {
        vertices: Vec<Place>,
        inside: bool,
    },
    Circle {
        centre: Place,
        radius_m: f64,
        inside: bool,
    },
}

/// Every border of a fence; inside of it is where all of them allow to be.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Fence {
    borders: Vec<Border>,
}

impl Fence {
    /// The fence of these items; none if they make none, such as a polygon with too few vertices.
    pub(crate) fn from_items(items: &[Item]) -> Option<Self> {
        let mut borders = Vec::new();
        let mut k = 0;
        while let Some(item) = items.get(k) {
            let mut used = 1;
            match item.command {
                MavCmd::MAV_CMD_NAV_FENCE_RETURN_POINT => {}
                MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION
                | MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION => borders.push(circle(item)?),
                _ => {
                    used = item.param1 as usize;
                    borders.push(polygon(items.get(k..k.checked_add(used)?)?)?);
                }
            }
            k += used;
        }
        Some(Self { borders })
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.borders.is_empty()
    }

    /// Whether the fence allows to be here.
    pub(crate) fn allows(&self, at: Enu, frame: &LocalFrame) -> bool {
        self.borders.iter().all(|border| match border {
            Border::Polygon { vertices, inside } => {
                let vertices: Vec<Enu> = vertices.iter().map(|&v| local(v, frame)).collect();
                air::area::is_inside(&vertices, at) == *inside
            }
            Border::Circle {
                centre,
                radius_m,
                inside,
            } => (at.distance_m(local(*centre, frame)) <= *radius_m) == *inside,
        })
    }
}

fn polygon(items: &[Item]) -> Option<Border> {
    let first = items.first()?;
    let alike = |i: &Item| i.command == first.command && i.param1 == first.param1;
    (items.len() >= 3 && items.iter().all(alike)).then(|| Border::Polygon {
        vertices: items.iter().map(|i| (i.x, i.y)).collect(),
        inside: first.command == MavCmd::MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION,
    })
}

fn circle(item: &Item) -> Option<Border> {
    let radius_m = f64::from(item.param1);
    (radius_m > 0.0).then(|| Border::Circle {
        centre: (item.x, item.y),
        radius_m,
        inside: item.command == MavCmd::MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION,
    })
}

/// A place given in 1e-7 degrees, in the site's plane.
pub(crate) fn local((lat_1e7, lon_1e7): Place, frame: &LocalFrame) -> Enu {
    frame.to_enu(Geodetic::new(
        f64::from(lat_1e7) / 1e7,
        f64::from(lon_1e7) / 1e7,
    ))
}
