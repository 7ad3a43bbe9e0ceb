//! Changes to the files of a case that must change a verdict, or must be said aloud.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::random::stream;

/// A change to observation CSV text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mutation {
    /// The readings of every platform in a random order of time.
    TimeShuffled,
    /// The readings, in order of time, under the platforms' names turned by one.
    LabelsSwapped,
    /// Readings in ppb.
    PartsPerBillion,
    /// Readings as a fraction of 1.
    Fraction,
    /// Latitude and longitude change places.
    PlacesSwapped,
    /// Altitudes in feet.
    Feet,
}

/// All of them.
pub const MUTATIONS: [Mutation; 6] = [
    Mutation::TimeShuffled,
    Mutation::LabelsSwapped,
    Mutation::PartsPerBillion,
    Mutation::Fraction,
    Mutation::PlacesSwapped,
    Mutation::Feet,
];

/// The columns that this crate writes first.
const PLATFORM: usize = 1;
const LAT: usize = 2;
const LON: usize = 3;
const ALT: usize = 4;
const CO2: usize = 5;

/// `text`, as a case has it, changed.
pub fn mutate(text: &str, mutation: Mutation, seed: u64) -> String {
    let mut lines = text.lines();
    let header = lines.next().unwrap_or("");
    let mut rows: Vec<Vec<String>> = lines
        .map(|l| l.split(',').map(str::to_owned).collect())
        .collect();
    match mutation {
        Mutation::TimeShuffled => shuffle(&mut rows, seed),
        Mutation::LabelsSwapped => relabel(&mut rows),
        Mutation::PartsPerBillion => scale(&mut rows, CO2, 1000.0),
        Mutation::Fraction => scale(&mut rows, CO2, 1e-6),
        Mutation::PlacesSwapped => rows.iter_mut().for_each(|r| r.swap(LAT, LON)),
        Mutation::Feet => scale(&mut rows, ALT, 1.0 / 0.3048),
    }
    let mut out = header.to_owned() + "\n";
    for row in rows {
        out.push_str(&row.join(","));
        out.push('\n');
    }
    out
}

/// Rows of each platform, by its name, in order of first appearance.
fn by_platform(rows: &[Vec<String>]) -> Vec<(String, Vec<usize>)> {
    let mut groups: Vec<(String, Vec<usize>)> = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        match groups.iter_mut().find(|g| g.0 == row[PLATFORM]) {
            Some(group) => group.1.push(index),
            None => groups.push((row[PLATFORM].clone(), vec![index])),
        }
    }
    groups
}

fn shuffle(rows: &mut [Vec<String>], seed: u64) {
    let mut rng = stream(seed, "shuffle");
    for (_, indices) in by_platform(rows) {
        for k in (1..indices.len()).rev() {
            let (a, b) = (indices[k], indices[rng.random_range(0..=k)]);
            let kept = rows[a][CO2].clone();
            rows[a][CO2] = std::mem::replace(&mut rows[b][CO2], kept);
        }
    }
}

fn relabel(rows: &mut [Vec<String>]) {
    let groups = by_platform(rows);
    let readings: Vec<Vec<String>> = groups
        .iter()
        .map(|(_, indices)| indices.iter().map(|&i| rows[i][CO2].clone()).collect())
        .collect();
    for (k, (_, indices)) in groups.iter().enumerate() {
        let from = &readings[(k + 1) % readings.len()];
        for (&index, reading) in indices.iter().zip(from) {
            rows[index][CO2].clone_from(reading);
        }
    }
}

fn scale(rows: &mut [Vec<String>], column: usize, factor: f64) {
    for row in rows {
        if let Ok(value) = row[column].parse::<f64>() {
            row[column] = (value * factor).to_string();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "time_s,platform,lat_deg,lon_deg,alt_amsl_m,co2_ppm\n\
                        0,a,1,2,30,400\n0,b,1,2,31,500\n1,a,1,2,30,401\n1,b,1,2,31,\n";

    fn readings(text: &str) -> Vec<String> {
        text.lines()
            .skip(1)
            .map(|l| l.rsplit(',').next().unwrap().to_owned())
            .collect()
    }

    #[test]
    fn each_changes_what_it_says() {
        assert_eq!(
            readings(&mutate(TEXT, Mutation::LabelsSwapped, 1)),
            ["500", "400", "", "401"]
        );
        assert_eq!(
            readings(&mutate(TEXT, Mutation::PartsPerBillion, 1))[0],
            "400000"
        );
        let mut shuffled = readings(&mutate(TEXT, Mutation::TimeShuffled, 1));
        shuffled.sort();
        assert_eq!(shuffled, ["", "400", "401", "500"]);
        assert!(mutate(TEXT, Mutation::PlacesSwapped, 1).contains("0,a,2,1,30"));
        assert!(mutate(TEXT, Mutation::Feet, 1).contains("98.425"));
    }
}
