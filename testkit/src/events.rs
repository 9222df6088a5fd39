//! Events (`tracing`) of the libraries, for tests of them.

use std::collections::BTreeMap;
use std::fmt::Debug;
use std::sync::{Mutex, OnceLock, PoisonError};
use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::layer::{Context, Layer, SubscriberExt as _};

/// An event.
#[derive(Clone, Debug)]
pub struct Collected {
    /// Name of the crate that emitted the event.
    pub target: &'static str,
    /// Severity.
    pub level: Level,
    /// Text of the event.
    pub message: String,
    /// Values of all other fields as text.
    pub fields: BTreeMap<&'static str, String>,
}

static EVENTS: Mutex<Vec<Collected>> = Mutex::new(Vec::new());

/// Collects the events of all threads of this process from now on.
pub fn start() {
    static STARTED: OnceLock<()> = OnceLock::new();
    STARTED.get_or_init(|| {
        let subscriber = tracing_subscriber::registry().with(Collector);
        tracing::subscriber::set_global_default(subscriber).unwrap();
    });
}

/// Events of Kinetoscope that `select` accepts, since [`start`]. Tests of one process run in parallel, so `select` has to
/// recognize the own events of a test.
pub fn collected(select: impl Fn(&Collected) -> bool) -> Vec<Collected> {
    let events = EVENTS.lock().unwrap_or_else(PoisonError::into_inner);
    events.iter().filter(|event| select(event)).cloned().collect()
}

struct Collector;

impl<S: Subscriber> Layer<S> for Collector {
    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let target = event.metadata().target();
        if !target.starts_with("kinetoscope") {
            return;
        }
        let mut reader = Reader { message: String::new(), fields: BTreeMap::new() };
        event.record(&mut reader);
        let Reader { message, fields } = reader;
        let event = Collected { target, level: *event.metadata().level(), message, fields };
        EVENTS.lock().unwrap_or_else(PoisonError::into_inner).push(event);
    }
}

struct Reader {
    message: String,
    fields: BTreeMap<&'static str, String>,
}

impl Visit for Reader {
    fn record_str(&mut self, field: &Field, value: &str) {
        self.fields.insert(field.name(), value.to_owned());
    }

    fn record_debug(&mut self, field: &Field, value: &dyn Debug) {
        match field.name() {
            "message" => self.message = format!("{value:?}"),
            name => drop(self.fields.insert(name, format!("{value:?}"))),
        }
    }
}
