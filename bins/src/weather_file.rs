//! The scenario's file of reported weather, read again while a mission flies in real time: a program that fetches
//! weather into it gives the mission real-time weather.

use crate::{Failure, mission_files};
use air::geo::LocalFrame;
use air::wind::{WindProfile, WindSeries};
use mission::Setup;
use protocol::SimTime;
use protocol::message::{Weather, WindRow};
use protocol::text::printable;
use scenario::weather::WeatherReports;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// How often it is looked at.
const EVERY: Duration = Duration::from_secs(2);

/// When a file was changed, and its length.
type Stamp = (SystemTime, u64);

/// A file of reported weather.
#[derive(Debug)]
pub struct WeatherFile {
    path: PathBuf,
    profile: WindProfile,
    frame: LocalFrame,
    /// When the mission began, s since 1970, once it has.
    start_unix_s: Option<f64>,
    next: Option<Instant>,
    /// As it was at the last look, and as it was when it was last read.
    seen: Option<Stamp>,
    read: Option<Stamp>,
    known: Option<(WindSeries, f64)>,
    /// What was said to be wrong with it.
    wrong: Option<String>,
}

impl WeatherFile {
    /// The file that the scenario at `scenario_path` names; none where it names none.
    ///
    /// # Errors
    /// A scenario that describes no wind.
    pub fn of(setup: &Setup, scenario_path: &Path) -> Result<Option<Self>, Failure> {
        let Some(name) = &setup.scenario.weather.series else {
            return Ok(None);
        };
        let folder = scenario_path.parent().unwrap_or(Path::new(""));
        let profile = setup.scenario.wind_profile().map_err(Failure::input)?;
        let path = mission_files::find(name, folder);
        let frame = setup.scenario.frame().map_err(Failure::input)?;
        Ok(path.map(|path| Self::new(path, profile, frame)))
    }

    fn new(path: PathBuf, profile: WindProfile, frame: LocalFrame) -> Self {
        Self {
            path,
            profile,
            frame,
            start_unix_s: None,
            next: None,
            seen: None,
            read: None,
            known: None,
            wrong: None,
        }
    }

    /// What is new in it at the mission's time `now`, if it is time for a look. What was known stands while the
    /// file is gone, half written, or older than it was; that is said once.
    pub fn poll(&mut self, now: SimTime) -> Option<Weather> {
        if self.next.is_some_and(|next| Instant::now() < next) {
            return None;
        }
        self.next = Some(Instant::now() + EVERY);
        match self.look(now) {
            Ok(news) => {
                if news.is_some() {
                    self.wrong = None;
                }
                news
            }
            Err(why) => {
                let words = format!(
                    "{}: {why}; the weather read before stays in use",
                    self.path.display()
                );
                if self.wrong.as_ref() != Some(&words) {
                    eprintln!("warning: {}", printable(&words));
                    self.wrong = Some(words);
                }
                None
            }
        }
    }

    fn look(&mut self, now: SimTime) -> Result<Option<Weather>, String> {
        let file = std::fs::metadata(&self.path).map_err(|e| format!("cannot be read: {e}"))?;
        let stamp = (file.modified().map_err(|e| e.to_string())?, file.len());
        // Who writes it may be half way: it is read when it has not changed for one look. At the start there was
        // no look before.
        let rests = self.seen.is_none_or(|seen| seen == stamp);
        self.seen = Some(stamp);
        if !rests || self.read == Some(stamp) {
            return Ok(None);
        }
        self.read = Some(stamp);
        let text =
            std::fs::read_to_string(&self.path).map_err(|e| format!("cannot be read: {e}"))?;
        self.take(&text, now).map(Some)
    }

    fn take(&mut self, text: &str, now: SimTime) -> Result<Weather, String> {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH);
        let unix_s = since_1970.map_or(0.0, |d| d.as_secs_f64());
        let start_unix_s = *self.start_unix_s.get_or_insert(unix_s - now.s());
        let height_agl_m = self.profile.reference_height_agl_m();
        let reports =
            WeatherReports::parse(text, height_agl_m, Some(unix_s)).map_err(|e| e.to_string())?;
        reports
            .check_place(&self.frame)
            .map_err(|e| e.to_string())?;
        if self
            .known
            .as_ref()
            .is_some_and(|(_, as_of_s)| reports.as_of_s < *as_of_s)
        {
            return Err("older than the weather read before".to_owned());
        }
        let newer = reports
            .series(&self.profile, Some(start_unix_s))
            .map_err(|e| e.to_string())?;
        let series = match &self.known {
            Some((before, _)) => before.followed_by(&newer),
            None => newer,
        };
        let row = |&(time_s, wind): &(f64, air::wind::WindVector)| WindRow {
            time_s,
            wind_ne_m_s: [wind.north_m_s, wind.east_m_s],
        };
        let wind = series.rows().iter().map(row).collect();
        self.known = Some((series, reports.as_of_s));
        Ok(Weather { wind })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "time_s,wind_speed_m_s,wind_from_deg\n";

    /// A file in a folder of its own, and a look at it without waiting.
    struct Watched(WeatherFile);

    impl Watched {
        fn new(name: &str, text: &str) -> Self {
            let folder =
                std::env::temp_dir().join(format!("plumage-weather-{}-{name}", std::process::id()));
            std::fs::create_dir_all(&folder).unwrap();
            let path = folder.join("weather");
            std::fs::write(&path, text).unwrap();
            Self(WeatherFile::new(
                path,
                WindProfile::new(5.0, 10.0, 270.0, 0.15).unwrap(),
                LocalFrame::new(43.44, -7.86, 340.0).unwrap(),
            ))
        }

        fn write(&self, text: &str) {
            std::fs::write(&self.0.path, text).unwrap();
        }

        /// What two looks at `now_s`, one after the other, find.
        fn twice(&mut self, now_s: f64) -> Option<Vec<f64>> {
            let mut look = || {
                self.0.next = None;
                self.0.poll(SimTime::from_s(now_s))
            };
            let news = [look(), look()].into_iter().flatten().last();
            news.map(|w| w.wind.iter().map(|r| r.wind_ne_m_s[1].round()).collect())
        }
    }

    impl Drop for Watched {
        fn drop(&mut self) {
            if let Some(folder) = self.0.path.parent() {
                let _ = std::fs::remove_dir_all(folder);
            }
        }
    }

    #[test]
    fn a_file_that_changes_is_read_again_and_what_is_no_weather_is_not() {
        let mut file = Watched::new("csv", &format!("{HEADER}0,5,270\n"));
        assert_eq!(file.twice(0.0), Some(vec![5.0]));
        assert_eq!(file.twice(2.0), None, "nothing new");
        file.write(&format!("{HEADER}0,5,270\n60,7,2"));
        // A cell cut short would read as a wind from north-north-east: only what rests is read.
        file.0.next = None;
        assert_eq!(file.0.poll(SimTime::from_s(60.0)), None);
        file.write(&format!("{HEADER}0,5,270\n60,7,270\n"));
        assert_eq!(file.twice(62.0), Some(vec![5.0, 7.0]));
        for gone in [
            "",
            "<html>",
            &format!("{HEADER}0,fast,270\n"),
            &format!("{HEADER}0,5,270\n"),
        ] {
            file.write(gone);
            assert_eq!(file.twice(64.0), None, "{gone}");
            assert!(file.0.wrong.is_some());
        }
        std::fs::remove_file(&file.0.path).unwrap();
        assert_eq!(file.twice(66.0), None);
        assert!(file.0.wrong.as_ref().unwrap().contains("cannot be read"));
        file.write(&format!("{HEADER}120,9,270\n"));
        assert_eq!(
            file.twice(120.0),
            Some(vec![5.0, 7.0, 9.0]),
            "what was known before stays"
        );
        assert_eq!(file.0.wrong, None);
    }

    #[test]
    fn times_of_day_are_those_of_the_mission_by_the_clock() {
        let unix_s = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .unwrap()
            .as_secs();
        let answer = |ago_s: u64, m_s: f64| {
            format!(
                "{{\"current_units\":{{\"wind_speed_10m\":\"m/s\",\"wind_direction_10m\":\"°\"}},\"current\":\
                 {{\"time\":{},\"wind_speed_10m\":{m_s},\"wind_direction_10m\":270}}}}",
                unix_s - ago_s
            )
        };
        let mut file = Watched::new("json", &answer(900, 4.0));
        let first = file.0.poll(SimTime::from_s(100.0)).unwrap();
        assert!((first.wind[0].time_s + 800.0).abs() < 5.0, "{first:?}");
        file.write(&answer(0, 8.0));
        assert_eq!(file.twice(100.0), Some(vec![4.0, 8.0]));
    }
}
