"""The engine: needs what is not there."""

import fake_backend

Engine = fake_backend.Engine
