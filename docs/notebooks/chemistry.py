# %% [markdown]
# # chemistry

# %%
import symrefine

print(symrefine.__version__)
