//! What a board forgets when it is reset.

use super::commands::CommandState;
use super::io_tables::IoCopies;
use super::lockout::Lockout;
use super::log_in::LogIns;
use super::presence::Presence;
use super::reason::Reason;
use super::receive_queue::ReceiveQueue;
use super::request_queue::RequestQueue;
use super::setup::Setup;
use super::status::BusErrors;
use crate::genius::outbox::Outbox;

pub(super) struct Live {
    pub(super) setup: Setup,
    pub(super) presence: Presence,
    pub(super) heartbeat_us: Option<u64>,
    pub(super) errors: BusErrors,
    pub(super) last_turn_us: Option<u64>,
    /// When the board gives up waiting for its turn.
    pub(super) turn_missed_us: Option<u64>,
    /// The controller that wants to be told of faults.
    pub(super) controller: Option<u8>,
    pub(super) log_ins: LogIns,
    pub(super) copies: IoCopies,
    pub(super) lockout: Lockout,
    pub(super) command: CommandState,
    /// When the board looks at the command block.
    pub(super) command_look_us: Option<u64>,
    pub(super) received: ReceiveQueue,
    pub(super) requests: RequestQueue,
    pub(super) outbox: Outbox<Reason>,
}

impl Live {
    pub(super) fn new(switches: u8) -> Live {
        Live {
            setup: Setup::new(switches),
            presence: Presence::Off { until_us: u64::MAX },
            heartbeat_us: None,
            errors: BusErrors::default(),
            last_turn_us: None,
            turn_missed_us: None,
            controller: None,
            log_ins: LogIns::default(),
            copies: IoCopies::default(),
            lockout: Lockout::default(),
            command: CommandState::Free,
            command_look_us: None,
            received: ReceiveQueue::default(),
            requests: RequestQueue::default(),
            outbox: Outbox::default(),
        }
    }
}
