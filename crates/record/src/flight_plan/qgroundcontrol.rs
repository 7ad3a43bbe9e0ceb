//! QGroundControl's `.plan`: JSON, version 1, with mission and fence (QGroundControl Developer Guide, *Plan File Format*).

use super::{FlightPlan, Heights, STOP_S};
use serde_json::{Value, json};

/// MAV_CMD: waypoint, return to launch, take-off, change of speed.
const WAYPOINT: u16 = 16;
const RETURN: u16 = 20;
const TAKE_OFF: u16 = 22;
const CHANGE_SPEED: u16 = 178;
/// MAV_FRAME: above mean sea level, above home, without a place.
const AMSL: u8 = 0;
const MISSION: u8 = 2;
const ABOVE_HOME: u8 = 3;
/// MAV_AUTOPILOT of ArduPilot; MAV_TYPE of a fixed wing and of a quadrotor.
const ARDUPILOT: u8 = 3;
const FIXED_WING: u8 = 1;
const QUADROTOR: u8 = 2;

/// The text of the file.
pub(super) fn encode(plan: &FlightPlan, heights: Heights) -> String {
    let (lat, lon, ground) = plan.home;
    let frame = frame(heights);
    let mut items: Vec<Value> = Vec::new();
    let mut item = |command: u16, frame: u8, params: Value, height: Option<f64>| {
        let number = items.len() + 1;
        let mut item = json!({
            "type": "SimpleItem",
            "autoContinue": true,
            "command": command,
            "doJumpId": number,
            "frame": frame,
            "params": params,
        });
        if let Some(height) = height {
            item["AMSLAltAboveTerrain"] = Value::Null;
            item["Altitude"] = json!(height);
            item["AltitudeMode"] = json!(mode(heights));
        }
        items.push(item);
    };
    let up = plan.height_m(ground + plan.take_off_height_m, heights);
    item(
        TAKE_OFF,
        frame,
        json!([0, 0, 0, null, lat, lon, up]),
        Some(up),
    );
    // 1: speed over ground; of a fixed wing 0: airspeed.
    let kind = u8::from(plan.multirotor);
    item(
        CHANGE_SPEED,
        MISSION,
        json!([kind, plan.speed_m_s, -1, 0, 0, 0, 0]),
        None,
    );
    for point in &plan.points {
        let height = plan.height_m(point.alt_amsl_m, heights);
        let wait_s = if point.stops { STOP_S } else { 0.0 };
        let params = json!([wait_s, 0, 0, null, point.lat_deg, point.lon_deg, height]);
        item(WAYPOINT, frame, params, Some(height));
    }
    item(RETURN, MISSION, json!([0, 0, 0, 0, 0, 0, 0]), None);
    let corners: Vec<Value> = plan.fence.iter().map(|(a, b)| json!([a, b])).collect();
    let polygons = if corners.is_empty() {
        json!([])
    } else {
        json!([{ "inclusion": true, "polygon": corners, "version": 1 }])
    };
    let document = json!({
        "fileType": "Plan",
        "version": 1,
        "groundStation": "QGroundControl",
        "geoFence": { "circles": [], "polygons": polygons, "version": 2 },
        "rallyPoints": { "points": [], "version": 2 },
        "mission": {
            "version": 2,
            "firmwareType": ARDUPILOT,
            "vehicleType": if plan.multirotor { QUADROTOR } else { FIXED_WING },
            "globalPlanAltitudeMode": mode(heights),
            "cruiseSpeed": plan.speed_m_s,
            "hoverSpeed": plan.speed_m_s,
            "plannedHomePosition": [lat, lon, ground],
            "items": items,
        },
    });
    format!("{document:#}\n")
}

fn frame(heights: Heights) -> u8 {
    match heights {
        Heights::TakeOff => ABOVE_HOME,
        Heights::Amsl => AMSL,
    }
}

/// QGroundControl's number of an altitude mode: relative, absolute.
fn mode(heights: Heights) -> u8 {
    match heights {
        Heights::TakeOff => 1,
        Heights::Amsl => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::plan;
    use super::*;

    /// Checks the keys and types that QGroundControl's loader requires of the file and its mission (Developer Guide, *Plan
    /// File Format*), of an item (MissionItem::load, SimpleMissionItem::load: all three heights or none) and of a fence
    /// (QGCFencePolygon::loadFromJson). A null stands for NaN.
    #[test]
    fn the_plan_has_the_keys_that_a_loader_requires() {
        let read: Value = serde_json::from_str(&encode(&plan(), Heights::TakeOff)).unwrap();
        let number = |v: &Value| v.is_number() || v.is_null();
        assert_eq!(
            (&read["fileType"], &read["version"]),
            (&json!("Plan"), &json!(1))
        );
        assert!(read["groundStation"].is_string());
        let mission = &read["mission"];
        assert_eq!(mission["version"], json!(2));
        for key in [
            "firmwareType",
            "vehicleType",
            "globalPlanAltitudeMode",
            "cruiseSpeed",
            "hoverSpeed",
        ] {
            assert!(mission[key].is_number(), "{key}");
        }
        assert_eq!(
            mission["plannedHomePosition"],
            json!([43.4395, -7.861, 340.0])
        );
        for (k, item) in mission["items"].as_array().unwrap().iter().enumerate() {
            assert_eq!(
                (&item["type"], &item["doJumpId"]),
                (&json!("SimpleItem"), &json!(k + 1))
            );
            assert!(item["frame"].is_number() && item["command"].is_number());
            assert!(item["autoContinue"].is_boolean());
            let params = item["params"].as_array().unwrap();
            assert!(params.len() == 7 && params.iter().all(number), "{params:?}");
            let has_place = [16, 22].contains(&item["command"].as_u64().unwrap());
            for key in ["AltitudeMode", "Altitude", "AMSLAltAboveTerrain"] {
                let there = item.get(key);
                assert!(
                    there.is_some() == has_place && there.is_none_or(number),
                    "{key}"
                );
            }
        }
        let fence = &read["geoFence"];
        assert_eq!(
            (&fence["version"], &fence["circles"]),
            (&json!(2), &json!([]))
        );
        let polygon = &fence["polygons"][0];
        assert_eq!(
            (&polygon["version"], &polygon["inclusion"]),
            (&json!(1), &json!(true))
        );
        assert_eq!(polygon["polygon"][0], json!([43.43, -7.87]));
        assert_eq!(read["rallyPoints"], json!({ "points": [], "version": 2 }));
    }

    #[test]
    fn the_plan_has_take_off_speed_places_and_return() {
        let plan = plan();
        let read: Value = serde_json::from_str(&encode(&plan, Heights::TakeOff)).unwrap();
        let items = read["mission"]["items"].as_array().unwrap();
        let commands: Vec<u64> = items
            .iter()
            .map(|i| i["command"].as_u64().unwrap())
            .collect();
        assert_eq!(commands, [22, 178, 16, 16, 16, 20]);
        assert_eq!(
            items[3]["params"],
            json!([0.0, 0, 0, null, 43.4401, -7.86, 40.0])
        );
        assert_eq!(
            (&items[3]["frame"], &items[3]["AltitudeMode"]),
            (&json!(3), &json!(1))
        );
        assert_eq!(
            read["geoFence"]["polygons"][0]["polygon"]
                .as_array()
                .unwrap()
                .len(),
            3
        );
        let read: Value = serde_json::from_str(&encode(&plan, Heights::Amsl)).unwrap();
        let place = &read["mission"]["items"][3];
        assert_eq!(
            (&place["Altitude"], &place["frame"]),
            (&json!(380.0), &json!(0))
        );
    }
}
