//! How a bridge behaves.

use super::checklist::Expectation;
use super::gas::GasInput;
use crate::arduplane::ARDUPLANE;
use crate::error::BridgeError;
use crate::profile::Profile;
use crate::wire::signing::SigningConfig;
use air::isa::Atmosphere;
use plume::Gas;

/// How a bridge behaves. [`BridgeConfig::default`] suits a real ArduPlane.
#[derive(Debug, Clone)]
pub struct BridgeConfig {
    /// The autopilot that is commanded; any other is watched.
    pub profile: &'static Profile,
    /// Own system id, that of a ground station; the vehicle's failsafe listens for this one.
    pub system_id: u8,
    /// Own component id.
    pub component_id: u8,
    /// System id of the vehicle; none accepts the only one received, and commands none of two.
    pub vehicle_system_id: Option<u8>,
    /// Component id of its autopilot.
    pub vehicle_component_id: u8,
    /// The site's atmosphere, for true airspeed.
    pub atmosphere: Atmosphere,
    /// The gas of the readings.
    pub gas: Gas,
    /// Name of its readings; if empty its formula, in ppm ("CH4"), or with the suffix "_PPB" in ppb.
    pub gas_inputs: Vec<GasInput>,
    /// The mission's expectations, for the checklist before the first command; none: no checklist.
    pub expectation: Option<Expectation>,
    /// Whether the team's outer loop flies it by attitude and thrust ([`Bridge::attitude`](super::Bridge::attitude)); else it flies to places by
    /// its own.
    pub attitude_targets: bool,
    /// Send nothing: no heartbeat, no request, no command.
    pub listen_only: bool,
    /// Send only requests for parameters and the fence; log every other frame.
    pub dry_run: bool,
    /// Whether parameters that the checklist finds wrong are set on board.
    pub set_parameters: bool,
    /// Whether to upload the mission's fence on the ground if the fence on board differs or is missing.
    pub set_fence: bool,
    /// Whether the bridge may arm the motor at take-off. Off by default: a person does that.
    pub may_arm: bool,
    /// Requested rate of position, attitude and airspeed, 1/s (1 to 50).
    pub telemetry_hz: f64,
    /// Silence after which the link counts as lost, s.
    pub link_timeout_s: f64,
    /// Time to wait for the answer to a command, s.
    pub ack_timeout_s: f64,
    /// How often a command is sent before it is given up.
    pub attempts: u32,
    /// Height above home at which the mode for setpoints follows the take-off if the vehicle does not report
    /// the altitude of that, m.
    pub guided_above_home_m: f64,
    /// Key shared with the vehicle: frames out are signed, unsigned ones in are refused.
    pub signing: Option<SigningConfig>,
}

impl Default for BridgeConfig {
    fn default() -> Self {
        Self {
            profile: &ARDUPLANE,
            system_id: 255,
            component_id: 190, // MAV_COMP_ID_MISSIONPLANNER: a ground station
            vehicle_system_id: None,
            vehicle_component_id: 1, // MAV_COMP_ID_AUTOPILOT1
            atmosphere: Atmosphere::standard(),
            gas: Gas::Co2,
            gas_inputs: Vec::new(),
            expectation: None,
            attitude_targets: false,
            listen_only: false,
            dry_run: false,
            set_parameters: false,
            set_fence: false,
            may_arm: false,
            telemetry_hz: 10.0,
            link_timeout_s: 5.0,
            ack_timeout_s: 1.0,
            attempts: 5,
            guided_above_home_m: 40.0,
            signing: None,
        }
    }
}

impl BridgeConfig {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`BridgeError::OutOfRange`].
    pub fn validated(self) -> Result<Self, BridgeError> {
        let checks = [
            ("telemetry_hz", self.telemetry_hz, 1.0, 50.0, "1 to 50"),
            (
                "link_timeout_s",
                self.link_timeout_s,
                1.5,
                60.0,
                "1.5 to 60 s",
            ),
            (
                "ack_timeout_s",
                self.ack_timeout_s,
                0.05,
                10.0,
                "0.05 to 10 s",
            ),
            ("attempts", f64::from(self.attempts), 1.0, 100.0, "1 to 100"),
            (
                "guided_above_home_m",
                self.guided_above_home_m,
                10.0,
                500.0,
                "10 to 500 m",
            ),
        ];
        for (what, value, low, high, expected) in checks {
            if !(low..=high).contains(&value) {
                return Err(BridgeError::OutOfRange {
                    what,
                    value,
                    expected,
                });
            }
        }
        Ok(self)
    }
}
