//! Measurements on their way: captured, and not to be read yet.

/// A queue of rows per environment, each row with the step at which it was captured. All memory is taken at construction.
#[derive(Clone, Debug)]
pub(crate) struct Delay {
    steps: u64,
    width: usize,
    capacity: usize,
    queues: Vec<Queue>,
    captured: Vec<u64>,
    rows: Vec<f64>,
}

/// A ring in the slots of one environment.
#[derive(Clone, Copy, Debug, Default)]
struct Queue {
    first: usize,
    len: usize,
}

impl Delay {
    /// How many rows of an environment can be on their way at once: with one captured every `period` steps, those of the
    /// last `steps` and the newest.
    pub(crate) fn capacity(steps: u64, period: u64) -> usize {
        usize::try_from(steps.div_ceil(period)).map_or(usize::MAX, |n| n.saturating_add(1))
    }

    /// Delays rows of `width` numbers, captured every `period` steps at most, by `steps`.
    pub(crate) fn new(num_envs: usize, width: usize, steps: u64, period: u64) -> Self {
        let capacity = Self::capacity(steps, period);
        let slots = num_envs * capacity;
        let (captured, rows) = (vec![0; slots], vec![0.0; slots * width]);
        Self { steps, width, capacity, queues: vec![Queue::default(); num_envs], captured, rows }
    }

    /// Sends a row on its way at `step`.
    pub(crate) fn push(&mut self, env: usize, step: u64, row: &[f64]) {
        let queue = &mut self.queues[env];
        if queue.len == self.capacity {
            // Nobody asked for a long time: what is oldest would have been overtaken anyway.
            *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        }
        let slot = env * self.capacity + (queue.first + queue.len) % self.capacity;
        queue.len += 1;
        self.captured[slot] = step;
        self.rows[slot * self.width..(slot + 1) * self.width].copy_from_slice(row);
    }

    /// Takes the oldest row of environment `env` that has arrived by `step`; gives the step of its capture.
    pub(crate) fn take(&mut self, env: usize, step: u64, row: &mut [f64]) -> Option<u64> {
        self.arrival(env).filter(|&arrival| arrival <= step)?;
        let queue = &mut self.queues[env];
        let slot = env * self.capacity + queue.first;
        *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        row.copy_from_slice(&self.rows[slot * self.width..(slot + 1) * self.width]);
        Some(self.captured[slot])
    }

    /// The step at which the next row of environment `env` arrives.
    pub(crate) fn arrival(&self, env: usize) -> Option<u64> {
        let queue = self.queues[env];
        (queue.len > 0).then(|| self.captured[env * self.capacity + queue.first] + self.steps)
    }

    /// Forgets what is on its way in environment `env`.
    pub(crate) fn clear(&mut self, env: usize) {
        self.queues[env] = Queue::default();
    }
}
