//! Measurements on their way: captured, and not to be read yet.

/// A queue of rows per environment, each row with the step at which it was captured. All memory is taken at construction.
#[derive(Clone, Debug)]
pub(crate) struct Delay {
    queues: Queues,
    width: usize,
    rows: Vec<f64>,
}

/// The queues themselves: which slot holds what, and since when. What is in a slot is kept by who owns them: `capacity` slots
/// per environment, one after the other.
#[derive(Clone, Debug)]
pub(crate) struct Queues {
    steps: u64,
    capacity: usize,
    queues: Vec<Queue>,
    captured: Vec<u64>,
}

/// A ring in the slots of one environment.
#[derive(Clone, Copy, Debug, Default)]
struct Queue {
    first: usize,
    len: usize,
}

impl Queues {
    /// How many slots an environment needs: with one filled every `period` steps, those of the last `steps` and the newest.
    pub(crate) fn capacity(steps: u64, period: u64) -> usize {
        usize::try_from(steps.div_ceil(period)).map_or(usize::MAX, |n| n.saturating_add(1))
    }

    /// Queues of what is captured every `period` steps at most, and arrives `steps` later.
    pub(crate) fn new(num_envs: usize, steps: u64, period: u64) -> Self {
        let capacity = Self::capacity(steps, period);
        Self { steps, capacity, queues: vec![Queue::default(); num_envs], captured: vec![0; num_envs * capacity] }
    }

    /// Number of slots of all environments.
    pub(crate) fn slots(&self) -> usize {
        self.captured.len()
    }

    /// The slot for what environment `env` captures at `step`.
    pub(crate) fn push(&mut self, env: usize, step: u64) -> usize {
        let queue = &mut self.queues[env];
        if queue.len == self.capacity {
            // Nobody asked for a long time: what is oldest would have been overtaken anyway.
            *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        }
        let slot = env * self.capacity + (queue.first + queue.len) % self.capacity;
        queue.len += 1;
        self.captured[slot] = step;
        slot
    }

    /// The slot of the oldest that has arrived in environment `env` by `step`, and the step of its capture. The slot is free
    /// then, and holds what it held until the next [`push`](Self::push).
    pub(crate) fn take(&mut self, env: usize, step: u64) -> Option<(usize, u64)> {
        self.arrival(env).filter(|&arrival| arrival <= step)?;
        let queue = &mut self.queues[env];
        let slot = env * self.capacity + queue.first;
        *queue = Queue { first: (queue.first + 1) % self.capacity, len: queue.len - 1 };
        Some((slot, self.captured[slot]))
    }

    /// The step at which the next arrives in environment `env`.
    pub(crate) fn arrival(&self, env: usize) -> Option<u64> {
        let queue = self.queues[env];
        (queue.len > 0).then(|| self.captured[env * self.capacity + queue.first] + self.steps)
    }

    /// Forgets what is on its way in environment `env`.
    pub(crate) fn clear(&mut self, env: usize) {
        self.queues[env] = Queue::default();
    }
}

impl Delay {
    /// Delays rows of `width` numbers, captured every `period` steps at most, by `steps`.
    pub(crate) fn new(num_envs: usize, width: usize, steps: u64, period: u64) -> Self {
        let queues = Queues::new(num_envs, steps, period);
        Self { rows: vec![0.0; queues.slots() * width], queues, width }
    }

    /// Sends a row on its way at `step`.
    pub(crate) fn push(&mut self, env: usize, step: u64, row: &[f64]) {
        let slot = self.queues.push(env, step);
        self.rows[slot * self.width..(slot + 1) * self.width].copy_from_slice(row);
    }

    /// Takes the oldest row of environment `env` that has arrived by `step`; gives the step of its capture.
    pub(crate) fn take(&mut self, env: usize, step: u64, row: &mut [f64]) -> Option<u64> {
        let (slot, captured) = self.queues.take(env, step)?;
        row.copy_from_slice(&self.rows[slot * self.width..(slot + 1) * self.width]);
        Some(captured)
    }

    /// The step at which the next row of environment `env` arrives.
    pub(crate) fn arrival(&self, env: usize) -> Option<u64> {
        self.queues.arrival(env)
    }

    /// Forgets what is on its way in environment `env`.
    pub(crate) fn clear(&mut self, env: usize) {
        self.queues.clear(env);
    }
}
